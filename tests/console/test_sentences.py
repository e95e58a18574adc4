"""Sentences beside the prompt: what the desk answers, and what a person sees who types in English."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from console.asking import put
from console.running import PATIENCE, Program, open_page
from console.test_backend import Stand, stand
from console.test_page import opened
from sleepcast.console.features.sentences import Phrase, Understand
from sleepcast.sentences import MAX_SENTENCE, SentenceError

__all__ = ["stand"]

expect.set_options(timeout=1000 * PATIENCE)

CREW = "(WHEN (> battery 60%) (JOIN crew))"
IN_WORDS = "rovers with more than 60 % battery join crew"


class TestDesk:
    def test_an_expression_is_said_with_the_parts_that_stand_for_each_other(self, stand: Stand) -> None:
        found = put(stand.desk, Phrase, 4, CREW)
        assert (found.serial, found.sentence) == (4, IN_WORDS)
        shown = [(IN_WORDS[start:end], CREW[first:last]) for start, end, first, last in found.parts]
        assert shown == [("with more than 60 % battery", "(> battery 60%)"), ("join crew", "(JOIN crew)")]

    @pytest.mark.parametrize("text", ["(MARK", "", "(+ 1 2)", "(WHEN (> (+ battery 1) 1) (MARK))"])
    def test_what_no_sentence_says_has_none(self, stand: Stand, text: str) -> None:
        assert put(stand.desk, Phrase, 1, text).sentence == ""

    def test_a_sentence_is_understood_with_the_words_of_these_robots(self, stand: Stand) -> None:
        found = put(stand.desk, Understand, 5, "rover3 goes to the house")
        assert (found.serial, found.text, found.unclear) == (5, "(WHEN (= id 3) (GOTO house_x house_y))", [])
        stand.station.send("(DEFVAR trips 0)", everybody=True)
        stand.run()
        assert put(stand.desk, Understand, 6, "all rovers set trips to 5").text == "(SETQ trips 5)"

    def test_what_is_not_understood_has_its_place_and_carets(self, stand: Stand) -> None:
        (found,) = put(stand.desk, Understand, 1, "rovers with more than 60 % batery stop").unclear
        assert (found.start, found.end) == (27, 33)
        assert "did you mean battery?" in found.message
        assert found.shown.splitlines()[-1] == " " * 29 + "^^^^^^"
        assert put(stand.desk, Understand, 1, "rover21 stops").text == ""

    def test_a_sentence_that_is_too_long_is_refused(self, stand: Stand) -> None:
        with pytest.raises(SentenceError, match="at most 2,000"):
            put(stand.desk, Understand, 1, "x" * (MAX_SENTENCE + 1))


def test_the_line_answers_both_and_refuses_what_is_too_long(program: Program) -> None:
    with open_page(program) as page:
        assert page.ask("phrase", text=CREW)["sentence"] == IN_WORDS
        assert page.ask("understand", text=IN_WORDS)["text"] == CREW
        assert "at most 2,000" in page.ask("understand", text="x" * 9000)["reason"]


@pytest.fixture
def shown(program: Program, context: BrowserContext) -> Iterator[Page]:
    yield from opened(program, context)


@pytest.mark.browser
def test_a_person_types_either_and_sees_the_other(shown: Page) -> None:
    line, field, lisp = shown.locator("#sentence-shown"), shown.locator("#sentence-text"), shown.locator("#text")
    expect(line).to_have_text(IN_WORDS)  # of the ready-made command that stands in the prompt

    # the part at the caret is marked
    lisp.press("Home")
    for _ in "(WHEN (> bat":
        lisp.press("ArrowRight")
    expect(line.locator("mark")).to_have_text("with more than 60 % battery")

    # the sentence is typed instead, from what stood there
    shown.keyboard.press("Control+;")
    expect(field).to_be_focused()
    expect(field).to_have_value(IN_WORDS)
    field.fill("rovers with more than 60 % batery join crew")
    expect(shown.locator("#sentence-backdrop .found")).to_have_text("batery")
    expect(shown.locator("#sentence-unclear")).to_contain_text("did you mean battery?")
    expect(lisp).to_have_value("")
    expect(shown.locator("#send")).to_be_disabled()
    field.press("Enter")  # sends nothing
    field.fill("rovers with less than 90 % battery and in")
    expect(shown.locator("#sentence-unclear")).to_have_text("Not finished: wanted the name of a group at the end")

    # what is understood is previewed, and sent as an expression
    field.fill("rovers with less than 90 % battery are now in team alpha")
    expect(lisp).to_have_value("(WHEN (< battery 90%) (JOIN alpha))")
    expect(shown.locator("#yes")).to_have_text(re.compile(r"\d"))
    field.press("Enter")
    expect(shown.locator("#commands tr code")).to_have_text("(WHEN (< battery 90%) (JOIN alpha))")
    expect(field).to_have_value("")

    field.press("ArrowUp")  # recalls what was sent
    expect(field).to_have_value("rovers with less than 90 % battery join alpha")

    # another command in the prompt is said in the field; one without a sentence ends it
    lisp.fill("(WHEN (IN alpha) (ST))")
    expect(field).to_have_value("members of alpha stop")
    lisp.fill("(WHEN (IN alpha) (DRIVE (+ 1 1) 0))")
    expect(shown.locator("#sentence-field")).to_be_hidden()
    expect(line).to_have_text("")
