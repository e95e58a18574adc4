"""`sleepcast eval`: values on standard output, one a line, and nothing else there."""

from __future__ import annotations

import json

import pytest

from cli.calling import called
from sleepcast.cli import main


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, list[str], str]:
    """The status, the lines on standard output, and standard error of `sleepcast eval ARGUMENTS`, in this process."""
    status = main(["eval", *arguments])
    captured = capsys.readouterr()
    return status, captured.out.splitlines(), captured.err


# ---- what the thesis and the first pages of the documentation show


def test_a_buffer_is_changed_by_messages_in_the_classic_dialect() -> None:
    done = called("eval", "--dialect", "classic", "(SETQQ E2 (+ V0 V1))", "E2", "(SETQ V0 100)", "E2", "(+ E2 E2)")
    assert (done.status, done.out, done.err) == (0, "0\n61\n100\n131\n262\n", "")


def test_the_cond_that_failed_in_both_modes() -> None:
    text = "(COND ((AND 1 0) 99) ((AND 1 1) 88))"
    faithful = called("eval", "--dialect", "faithful", text)
    assert (faithful.status, faithful.out) == (0, "0\n")
    assert faithful.err == "eval(COND ) found COND instead of '('\n"
    repaired = called("eval", "--dialect", "classic", text)
    assert (repaired.status, repaired.out, repaired.err) == (0, "88\n", "")


@pytest.mark.parametrize("text", ["(AND (> fuel 50) (> ordnance 70))", "(NOT (> ordnance 70))"])
def test_a_name_that_nobody_declared_is_unknown_with_a_warning(text: str) -> None:
    done = called("eval", "--set", "fuel=80", text)
    assert (done.status, done.out) == (0, "UNKNOWN\n")
    assert 'unknown name "ordnance"' in done.err
    assert "^^^^^^^^" in done.err


def test_one_value_a_line_in_one_memory() -> None:
    done = called("eval", "(DEFVAR a 4)", "(SETQ a (+ a 1))", "(/ a 2)", "1e300", "-7", "-.5", "UNKNOWN")
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines() == ["4", "5", "2.5", "1e+300", "-7", "-0.5", "UNKNOWN"]


# ---- what goes where, and how it ends


@pytest.mark.parametrize("text", ["fuel > 50", "(+ 1", ")", "", "1 2", "5 m"])
def test_what_is_no_expression_prints_no_value(capsys: pytest.CaptureFixture[str], text: str) -> None:
    status, values, said = run(capsys, text)
    assert (status, values) == (2, [])
    assert said.startswith("error: ")
    status, values, said = run(capsys, text, "(+ 1 1)", "--json")
    assert [json.loads(line)["value"] for line in values] == [None, 2], "whoever reads JSON gets a line for each"


def test_reports_faults_and_warnings_go_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    status, values, said = run(capsys, '(REPORT "fuel" 1 2.5)', "(PRINT 3)", "(/ 1 0)", "(TELL (MARK))", "(+ lost 1)")
    assert values == ["2.5", "3", "UNKNOWN", "1", "UNKNOWN"]
    assert said.splitlines() == [
        "fuel: 1 2.5",
        "3",
        "warning: (/ 1 0) at 1:6 divides by zero, which is a fault",
        "  (/ 1 0)",
        "       ^",
        "fault: division by zero in (/ 1 0)",
        "told to other robots: (MARK)",
        'warning: unknown name "lost" at 1:4',
        "  (+ lost 1)",
        "     ^^^^",
    ]
    assert status == 1


@pytest.mark.parametrize(
    ("arguments", "status", "values"),
    [
        (["UNKNOWN"], 0, ["UNKNOWN"]),
        (["(/ 1 0)", "1"], 1, ["UNKNOWN", "1"]),
        (["(SETQ lost 1)"], 1, ["UNKNOWN"]),
        (["(SQRT 1 2)", "1"], 1, ["UNKNOWN", "1"]),
        (["(SETQ time 1)"], 1, ["UNKNOWN"]),
        (["(+ 1", "1"], 2, ["1"]),
        (["1 2"], 2, []),
        ([""], 2, []),
        (["(/ 1 0)", "(+ 1", "(/ 1 0)"], 2, ["UNKNOWN", "UNKNOWN"]),
        (["--dialect", "classic", "(/ 4 0)", "5"], 1, ["UNKNOWN", "5"]),
        (["--dialect", "classic", "(SETQ E2 (30500))", "5"], 2, ["5"]),
        (["--dialect", "faithful", "(SETQ a (5))"], 0, ["0"]),
        (["--dialect", "classic", ""], 2, []),
    ],
)
def test_the_status_says_how_it_ended(
    capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, values: list[str]
) -> None:
    found, printed, said = run(capsys, *arguments)
    assert (found, printed) == (status, values)
    assert bool(said) == (status > 0 or "faithful" in arguments)


def test_an_error_has_a_caret_and_a_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    _, _, said = run(capsys, "--set", "fuel=5", "(> feul 5m)")
    assert said.splitlines() == [
        'warning: unknown name "feul" at 1:4 (did you mean fuel?)',
        "  (> feul 5m)",
        "     ^^^^",
    ]


def test_the_values_stay_in_order_with_what_is_said_about_them() -> None:
    done = called("eval", "1", "(/ 1 0)", "2")
    assert done.out == "1\nUNKNOWN\n2\n"


# ---- settings


def test_units_are_allowed_in_settings(capsys: pytest.CaptureFixture[str]) -> None:
    status, values, said = run(
        capsys,
        "--set",
        "d=5mi",
        "--set",
        "fuel=80%",
        "--set",
        "turn=-90deg",
        "--set",
        " Caste = 3 ",
        "d",
        "fuel",
        "turn",
        "CASTE",
    )
    assert (status, said) == (0, "")
    assert values == ["8046.72", "0.8", "-1.5707963267948966", "3"]


@pytest.mark.parametrize(
    ("setting", "value"), [("x=TRUE", "1"), ("x=UNKNOWN", "UNKNOWN"), ("x=pi", "3.141592653589793")]
)
def test_constants_are_allowed_too(capsys: pytest.CaptureFixture[str], setting: str, value: str) -> None:
    assert run(capsys, "--set", setting, "x")[:2] == (0, [value])


def test_support_variables_can_be_set_and_the_last_setting_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "--set", "marked=1", "--set", "a=1", "--set", "A=2", "marked", "a")[1] == ["1", "2"]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("x", "wanted NAME=VALUE"),
        ("=4", "is no name"),
        ("5=4", "is no name"),
        ("a b=4", "is no name"),
        ("x=", "no expression"),
        ("x=1 2", "one more expression"),
        ("x=(+ 1 2)", "must be a number"),
        ("x=high", "must be a number"),
        ("x=1e999", "too large"),
        ("x=5parsec", "unknown unit"),
        ("and=1", "and is a function"),
        ("E5=1", "E5 is a buffer"),
        ("PI=3", "PI is a constant"),
        ("time=3", "time is a sensor variable"),
    ],
)
def test_a_setting_that_makes_no_sense_is_misuse(capsys: pytest.CaptureFixture[str], setting: str, words: str) -> None:
    status, values, said = run(capsys, "--set", setting, "1")
    assert (status, values) == (2, [])
    assert said.startswith(f"--set {setting.strip()}: ")
    assert words in said
    assert "(SETQ" not in said, "how it is done inside is nobody's business"


def test_settings_of_the_classic_dialect(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "--dialect", "classic", "--set", "v1=-7", "V1")[1] == ["-7"]
    for setting in ("a=1", "V6=1", "V1=x", "V1=40000", "V1=1.5", "V1=5m"):
        status, _, said = run(capsys, "--dialect", "classic", "--set", setting, "V1")
        assert status == 2
        assert said.startswith(f"--set {setting}: the classic dialect has")


# ---- chance, explanations, JSON


def test_the_seed_sets_chance(capsys: pytest.CaptureFixture[str]) -> None:
    text = "(RANDOM 0 1)"
    default = run(capsys, text, text)[1]
    assert default == run(capsys, "--seed", "0", text, text)[1]
    assert default != run(capsys, "--seed", "1", text, text)[1]
    assert default[0] != default[1]


def test_explain_shows_the_tree_and_why_not(capsys: pytest.CaptureFixture[str]) -> None:
    _, values, said = run(capsys, "--set", "fuel=40%", "--explain", "(AND (> fuel 50%) (> 2 1))")
    assert values == ["0"]
    assert said.splitlines()[-1] == "not for this robot: fuel = 40 %, needed > 50 %"
    assert "40 %      fuel" in said
    assert ".    (> 2 1)" in said


def test_the_classic_dialect_has_nothing_to_explain(capsys: pytest.CaptureFixture[str]) -> None:
    status, values, said = run(capsys, "--dialect", "faithful", "--explain", "1")
    assert (status, values) == (2, [])
    assert said.startswith("--explain needs the standard dialect")


def test_json_has_one_object_for_each_expression(capsys: pytest.CaptureFixture[str]) -> None:
    status, lines, _ = run(
        capsys,
        "--json",
        "--explain",
        "--set",
        "a=1",
        "(AND a 2)",
        '(PROGN (REPORT "x" a UNKNOWN) (/ 1 0))',
        "(SQRT)",
        "(",
        "(> b 1)",
    )
    found = [json.loads(line) for line in lines]
    assert status == 2
    assert [(each["value"], each["status"]) for each in found] == [(2.0, 0), (None, 1), (None, 1), (None, 2), (None, 0)]
    assert found[0]["matched"] is True
    assert found[0]["explanation"]["root"]["text"] == "(AND a 2)"
    assert found[1]["faults"] == ["division by zero in (/ 1 0)"]
    assert found[1]["printed"] == [{"label": "x", "values": [1.0, None]}]
    assert found[1]["steps"] <= found[1]["cost"]
    assert found[2]["errors"][0]["message"].startswith("(SQRT x) takes 1 argument, got 0")
    assert "not closed" in found[3]["error"]
    assert found[4]["warnings"] == [{"message": 'unknown name "b" at 1:4', "start": 3, "end": 4}]


def test_json_of_the_classic_dialect(capsys: pytest.CaptureFixture[str]) -> None:
    _, lines, _ = run(capsys, "--json", "--dialect", "faithful", "(5)", "(/ 4 0)")
    assert json.loads(lines[0]) == {
        "text": "(5)",
        "value": 0,
        "status": 0,
        "messages": ["eval() found token 5 after '('"],
        "error": None,
    }
    assert json.loads(lines[1])["value"] is None


# ---- standard input


def test_expressions_from_standard_input() -> None:
    text = '; a script\n(DEFVAR a 1) (SETQ a\n  (+ a 1))\n\n-5\r\n(REPORT "( not open" a)\na'
    done = called("eval", "-", typed=text)
    assert done.out.splitlines() == ["1", "2", "-5", "2", "2"]
    assert done.err == "( not open: 2\n"


def test_standard_input_among_other_expressions() -> None:
    done = called("eval", "(DEFVAR a 1)", "-", "(+ a 1)", typed="(SETQ a 5)")
    assert done.out.splitlines() == ["1", "5", "6"]


def test_standard_input_ends_at_what_cannot_be_read() -> None:
    done = called("eval", "-", typed="(+ 1 2)\n\n(* 2 2))\n(+ 3 4)\n")
    assert done.out.splitlines() == ["3"]
    assert "line 3 of the input" in done.err
    assert done.status == 2


def test_the_interactive_form_of_the_original_program() -> None:
    done = called("eval", "--dialect", "classic", "-", typed="(SETQ V2 5)@\n V2 @(PRINT V2)@ $ (this is not read")
    assert (done.status, done.out, done.err) == (0, "5\n5\n0\n", "V2 = 5\n")
    unfinished = called("eval", "--dialect", "faithful", "-", typed="5@ V2")
    assert (unfinished.status, unfinished.out) == (2, "5\n")
    assert "no '@' behind it" in unfinished.err


def test_plain_lines_in_the_classic_dialect() -> None:
    done = called("eval", "--dialect", "classic", "-", typed="(SETQ V2\n 5)\n\nV2\n")
    assert done.out == "5\n5\n"


@pytest.mark.parametrize("dialect", ["standard", "classic"])
def test_empty_input_gives_nothing(dialect: str) -> None:
    done = called("eval", "--dialect", dialect, "-", typed="\n  \n")
    assert (done.status, done.out, done.err) == (0, "", "")


# ---- bad input


def test_bytes_that_are_no_text() -> None:
    done = called("eval", "-", typed=b"(+ 1 2)\n(+ \xff 1)\n")
    assert (done.status, done.out) == (2, "")
    assert done.err == "standard input, line 2, is not UTF-8 text: byte 0xff at offset 11; save it as UTF-8\n"
    done = called("eval", b"(+ \xff 1)")
    assert (done.status, done.out) == (2, "")
    assert "Traceback" not in done.err


def test_too_much_text(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, said = run(capsys, "(+ " + "1 " * 9000 + ")")
    assert status == 2
    assert "at most 16384" in said
    done = called("eval", "-", typed=b"1\n" * 3_000_000)
    assert done.status == 2
    assert done.err.startswith("standard input is larger than")


@pytest.mark.parametrize(
    "text", ["(" * 5000, "'" * 5000, "(" * 5000 + ")" * 5000, "((((", ")", '"', "(\x00)", "5mmm", "(+ 1 5x5x)"]
)
def test_malformed_text_is_a_sentence(capsys: pytest.CaptureFixture[str], text: str) -> None:
    for dialect in ("standard", "classic"):
        status, values, said = run(capsys, "--dialect", dialect, text)
        assert "Traceback" not in said
        assert status in (0, 1, 2)
        assert len(values) == (status < 2)
    assert run(capsys, text)[0] == 2


def test_an_endless_evaluation_ends_with_a_fault(capsys: pytest.CaptureFixture[str]) -> None:
    loop = "(DOTIMES (i 1000) (DOTIMES (j 1000) (+ i j)))"
    status, values, _ = run(capsys, f"(DEFUN spin () {loop})", "(+ 1 2)")
    assert status == 1
    assert values == ["UNKNOWN", "3"]


def test_a_share_that_is_far_above_one_is_doubted() -> None:
    """A robot's fuel has a declared range; what is set here has none, so what it is compared with must tell."""
    done = called("eval", "--set", "fuel=80", "(> fuel 50%)")
    assert (done.out, done.status) == ("1\n", 0)
    assert "warning: fuel at 1:4 is 80, and 50% is a share: they run from 0 to 1 (did you mean 80%?)" in done.err
    assert "^^^^" in done.err
    assert "did you mean" not in called("eval", "--set", "fuel=800", "(> fuel 50%)").err
    for fine in (("fuel=80%", "(> fuel 50%)"), ("fuel=80", "(> fuel 50)"), ("fuel=1.2", "(< fuel 200%)")):
        assert called("eval", "--set", *fine).err == ""
