"""`sleepcast check`: every finding with its place and a caret, the cost, and a status for scripts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cli.calling import called
from sleepcast.cli import main

CASES = Path(__file__).resolve().parent.parent / "cases"


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    """The status and both streams of `sleepcast check ARGUMENTS`, in this process."""
    status = main(["check", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_everything_is_found_in_one_pass(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "(PROGN (SQRT 1 2)\n  (SETQ time 3) (> lost 2) (+ 1m 1s))")
    assert (status, err) == (2, "")
    assert out.splitlines() == [
        "error: (SQRT x) takes 1 argument, got 2 at 1:8",
        "  (PROGN (SQRT 1 2)",
        "         ^^^^^^^^^^",
        "error: time at 2:9 is a sensor: it can be read, not assigned",
        "    (SETQ time 3) (> lost 2) (+ 1m 1s))",
        "          ^^^^",
        'warning: unknown name "lost" at 2:20',
        "    (SETQ time 3) (> lost 2) (+ 1m 1s))",
        "                     ^^^^",
        "warning: 1s at 2:34 is a time, but the rest of + is a length",
        "    (SETQ time 3) (> lost 2) (+ 1m 1s))",
        "                                   ^^",
        "1 expression, at most 9 steps; 2 errors, 2 warnings",
    ]


def test_a_sound_expression_has_a_cost(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "(+ 1 (* 2 3))") == (0, "1 expression, at most 5 steps; 0 errors, 0 warnings\n", "")


def test_strict_takes_warnings_for_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "(> lost 2)")[0] == 0
    assert run(capsys, "--strict", "(> lost 2)")[0] == 2
    assert run(capsys, "--strict", "(> 3 2)")[0] == 0


@pytest.mark.parametrize("text", ["(+ 1", "", "1 2", ")", '"', "(" * 40 + ")" * 40])
def test_what_cannot_be_read_is_an_error_with_a_caret(capsys: pytest.CaptureFixture[str], text: str) -> None:
    status, out, err = run(capsys, text)
    assert (status, err) == (2, "")
    assert out.startswith("error: ")
    assert "^" in out
    assert "1 error" in out


def test_the_names_of_a_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(
        capsys, "--scenario", "bravo", "(WHEN (AND (> fuel 50) (> ordnanse 70%)) (GOTO vessel_x vessel_y))"
    )
    assert status == 0
    assert "is never true: fuel runs from 0 % to 100 % (did you mean 50%?)" in out
    assert "did you mean ordnance?" in out
    assert "0 errors, 2 warnings" in out
    status, out, err = run(capsys, "--scenario", "brvo", "1")
    assert (status, out) == (2, "")
    assert "did you mean bravo?" in err


def test_what_one_expression_declares_the_next_may_use(capsys: pytest.CaptureFixture[str]) -> None:
    texts = (
        "(DEFVAR limit 5)",
        "(DEFUN rich (share) (> limit share))",
        "(RULE patrol (WHEN (rich 3) (MARK)))",
        "(SETQQ E5 (+ limit 1))",
        "(JOIN bravo)",
        "(PROGN (DEACTIVATE patrol) (LEAVE bravo) (SETQ limit E5) patrol)",
    )
    assert run(capsys, *texts) == (0, "6 expressions, at most 45 steps each; 0 errors, 0 warnings\n", "")
    status, out, _ = run(capsys, "(DEFUN a () 1)", "(DEFUN b () (a))", "(DEFUN a () (b))")
    assert status == 2
    assert "would name itself" in out


def test_the_arguments_of_learned_operators_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "(DEFUN rich (share) (> 5 share))", "(rich)")
    assert status == 2
    assert "(rich share)" in out


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "--json", "(PROGN\n (> lost 2))", "(SQRT", "7")
    found = json.loads(out)
    assert status == 2
    assert (found["errors"], found["warnings"]) == (1, 1)
    assert [each["cost"] for each in found["expressions"]] == [4, None, 1]
    assert found["expressions"][0]["findings"] == [
        {
            "severity": "warning",
            "message": 'unknown name "lost" at 2:5',
            "line": 2,
            "column": 5,
            "start": 11,
            "end": 15,
        }
    ]
    assert found["expressions"][1]["findings"][0]["severity"] == "error"


# ---- files


def test_a_file_of_expressions_tells_the_line_of_each(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "plain.txt"
    file.write_text("; rules\n(DEFVAR a 1) (SETQ a\n  (+ a 1)) (> a\n lost)\n\n(SQRT))\n(+ a 1)\n", encoding="utf-8")
    status, out, _ = run(capsys, file)
    assert status == 2
    assert f'{file}:4: warning: unknown name "lost"\n' in out
    assert f"{file}:6: error: ) closes nothing" in out
    assert "5 expressions" in out


def test_a_mission_script(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "raid.sleep"
    file.write_text("; a raid\n@10s (JOIN bravo)\n@1min (WHEN (IN bravo)\n  (SQRT))\n", encoding="utf-8")
    status, out, _ = run(capsys, file)
    assert status == 2
    assert f"{file}:4: error: (SQRT x) takes 1 argument, got 0\n" in out
    assert "2 expressions" in out
    file.write_text("@10parsec (JOIN bravo)\n", encoding="utf-8")
    status, out, err = run(capsys, file)
    assert (status, out) == (2, "")
    assert err.startswith(f"{file}:1: wanted a time with its unit")


def test_a_file_of_cases(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "small.cases"
    file.write_text(
        "# a comment\n--- a title\n:set a=1\n(+ 1\n   2) => 3\n\n(SQRT) => error: takes\n", encoding="utf-8"
    )
    status, out, _ = run(capsys, file)
    assert status == 2
    assert f"{file}:7: error" in out
    assert "2 expressions" in out
    file.write_text("(+ 1 2)\n", encoding="utf-8")
    assert "wanted EXPRESSION => VALUE" in run(capsys, file)[2]


def test_the_projects_own_cases_can_be_checked(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, CASES / "arithmetic.cases")
    assert status == 0
    assert int(out.splitlines()[-1].split()[0]) > 50


def test_standard_input() -> None:
    done = called("check", "-", typed="(+ 1 2)\n(> lost\n  2)\n")
    assert done.status == 0
    assert "standard input:2: warning" in done.out


def test_a_name_is_an_expression_unless_it_is_a_file(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert "unknown name" in run(capsys, "--", "fuel")[1]
    Path("fuel").write_text("(+ 1 2)\n(+ 3 4)\n", encoding="utf-8")
    assert "2 expressions" in run(capsys, "fuel")[1]


@pytest.mark.parametrize("name", ["gone.sleep", "gone.cases", "gone.txt"])
def test_a_file_that_is_not_there_is_told(capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert run(capsys, name) == (2, "", f"there is no file {name}\n")


def test_what_is_no_text_file_is_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run(capsys, tmp_path) == (2, "", f"{tmp_path} is a directory: name a file in it\n")
    (tmp_path / "x.lisp").write_bytes(b"(+ 1 2)\n\x80\n")
    status, _, err = run(capsys, tmp_path / "x.lisp")
    assert status == 2
    assert err == f"{tmp_path / 'x.lisp'}, line 2, is not UTF-8 text: byte 0x80 at offset 8; save it as UTF-8\n"
    (tmp_path / "big.txt").write_bytes(b"1\n" * 2_100_000)
    assert "is larger than 4194304 bytes" in run(capsys, tmp_path / "big.txt")[2]


def test_a_negative_number_is_no_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "-5", "-.5m")[0] == 0
