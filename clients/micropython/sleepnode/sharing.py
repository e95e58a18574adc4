"""SHARE, a value that robots keep alike, written out in ordinary forms. BETTER and WORSE stand for the signs of a
better value and of one that is worse by C; the other names are those of `remembering.py`."""

from micropython import const

from sleepnode.reader import read
from sleepnode.remembering import filled

_MAX_PREFIX = const(48)

_TURN = "(AND %s (= (MOD (+ tick id) 5) 0) (OR (NOT (KNOWN P)) (/= %s P) (= (MOD (+ tick id) 50) 0)))"
_BEST = (
    "(LET ((N (DEFVAR A)) (P (DEFVAR M))) (WHEN "
    + _TURN % ("(KNOWN N)", "N")
    + " (SETQ M N) (TELL `(WHEN (OR (NOT (KNOWN (DEFVAR A))) (BETTER ,(WORSE N C) A)) (SETQ A ,(WORSE N C))))) N)"
)
_NEWEST = (
    "(LET ((N (DEFVAR A)) (P (DEFVAR M))) (DEFVAR MERGED) (DEFVAR VERSION 0)"
    " (WHEN (AND (KNOWN N) (OR (NOT (KNOWN MERGED)) (/= N MERGED))) (SETQ MERGED N) (SETQ VERSION (+ VERSION 1)))"
    " (WHEN " + _TURN % ("(KNOWN MERGED)", "VERSION") + " (SETQ M VERSION) (TELL `(PROGN (DEFVAR A) (DEFVAR MERGED)"
    " (WHEN (OR (> ,VERSION (DEFVAR VERSION 0)) (AND (= ,VERSION VERSION) (> ,MERGED MERGED)))"
    " (SETQ VERSION ,VERSION) (SETQ MERGED ,MERGED) (SETQ A ,MERGED))))) N)"
)
_MERGED = {"max": (_BEST, ">", "-"), "min": (_BEST, "<", "+"), "newest": (_NEWEST, ">", "-")}


def shared(form, rule):
    """A SHARE in a rule, written out; the form itself if it is not written as it should be."""
    fine = 3 <= len(form) <= 4 and isinstance(form[1], str) and isinstance(form[2], str)
    how = form[2].lower() if fine else ""
    if how not in _MERGED:
        return form
    step = form[3] if len(form) > 3 else (0.0, "0", True)
    if not isinstance(step, tuple) or step[0] < 0 or (len(form) > 3 and how == "newest"):
        return form
    text, better, worse = _MERGED[how]
    name = form[1]
    prefix = "%s_share%d" % (rule.key[:_MAX_PREFIX], len(rule.resets) + 1)
    values = {"n": [prefix + "_now"], "p": [prefix + "_before"], "m": [prefix], "a": [name], "c": [step]}
    values["better"], values["worse"] = [better], [worse]
    values["merged"] = [name.lower()[:_MAX_PREFIX] + "_merged"]
    values["version"] = [name.lower()[:_MAX_PREFIX] + "_version"]
    rule.resets.append(filled(read("(PROGN (DEFVAR A) (DEFVAR M) (SETQ M UNKNOWN))"), values)[0])
    return filled(read(text), values)[0]
