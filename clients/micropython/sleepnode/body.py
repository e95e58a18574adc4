"""The body of a robot: what its own software gives the node, as functions."""

from sleepnode.checker import Function


class Body:
    """Sensors, actuators, constants and functions by name, before the node starts. stop: brings everything to rest;
    release: called when a STOP ends."""

    def __init__(self, stop, release=None):
        self.stop, self.release = stop, release or (lambda: None)
        self.sensors, self.actuators, self.constants, self.functions = [], [], {}, []

    def sensor(self, name, read, unit="", low=None, high=None):
        """read: gives the value in SI, None if it is not known now; it is called at every tick."""
        self.sensors.append((name, read, unit, low, high))

    def actuator(self, name, write, unit="", low=None, high=None):
        """write: takes the value in SI, at the end of a tick in which it was assigned."""
        self.actuators.append((name, write, unit, low, high))

    def constant(self, name, value):
        self.constants[name] = value

    def function(self, name, call, arguments=0, least=None, acts=True, labelled=False):
        """call: takes `arguments` numbers, behind a text if it is labelled; gives a number or None."""
        more = 1 if labelled else 0
        fewest = arguments if least is None else least
        self.functions.append(Function(name, call, fewest + more, arguments + more, acts, labelled))

    def sense(self, mind, first):
        """Read every sensor; one that fails is unknown."""
        for at, (_, read, _, _, _) in enumerate(self.sensors):
            try:
                value = read()
                mind.values[first + at] = None if value is None else float(value)
            except Exception:
                mind.values[first + at] = None

    def act(self, mind):
        """Write the actuators that were assigned in this tick; gives what failed."""
        failed = ""
        for slot in mind.dirty:
            name, write = self.actuators[slot - mind.first_actuator][:2]
            try:
                write(mind.values[slot])
            except Exception as error:
                failed = "%s failed: %r" % (name, error)
        mind.dirty = []
        return failed
