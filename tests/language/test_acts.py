"""The table of acts, and those who do them."""

from sleepcast.fleet import memory as fleet
from sleepcast.language.acts import ACTS, FLAGS
from sleepcast.node import memory as node


def test_each_machine_does_every_act() -> None:
    assert set(node.ACTS) | set(FLAGS) == set(fleet.ACTS) | set(FLAGS) == set(ACTS)
    assert not set(node.ACTS) & set(FLAGS)
