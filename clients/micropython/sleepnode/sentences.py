"""What a refusal says, by its number. Loaded for one sentence and let go again. Sixteen stand in each text,
because a text for each would take twice the memory."""

_TEXTS = (
    """unknown unit "%s"
%s is too large for a number
"%s" is neither a number nor a name
"%s" has a character that no name has
"%s" is no name here: write (OR ...)
name of %d characters: at most %d
a label with a control character
label of %d characters: at most %d
%s has nothing after it
a "(" is not closed: add %d ) at the end
a " without its closing "
) closes nothing: there is one ) too many
nested too deeply: at most %d levels
text of %d characters: at most %d fit
one more expression: put several into (PROGN ...)
no expression: wanted a number, a name or (function argument ...)
""",
    """%s wants a text in quotes, such as "here"
%s takes %s argument%s, got %d
%s is a %s, not a function: its name alone gives its value
a list begins with a function's name: wanted (function argument ...)
nothing in the parentheses: wanted (function argument ...)
%s is %s %s: write (%s)
E0 is the message itself: it cannot be named in an expression
%s is a function: write (%s ...)
a text in quotes stands only as the label of REPORT, PRINT or TK
%s is a constant: choose another name
%s is already %s %s: choose another name for the %s
%s would name itself%s: an evaluation must end
%d local names: at most %d
this may cost %d steps, at most %d are allowed
%s remembers from tick to tick: it stands in a rule, (RULE name ...)
a quoted expression stands only as what SETQ stores into a buffer, and inside TELL
""",
    """TELL tells one expression: what follows it can only be :hops and 1 to %d
%s wants the name of a group
%s is a %s, not a rule
E0 is the message itself: it is evaluated once and never active
the name of a rule or buffer is wanted
%s takes arguments, so it is not an area
%s is %s %s, not an area
%s wants the name of an area
corners %d and %d are the same: leave one out
an area of %d corners: wanted at least 3, or x, y and radius of a disc
%d numbers are no corners: wanted x and y of each, or x, y and radius of a disc
the radius of an area must be more than 0, not %s
AREA wants a name, then its corners
%d numbers: wanted x and y of a point and of each corner
a parameter is named twice
DEFUN wants its parameters in parentheses: (name ...)
""",
    """%s wants a name
E0 holds the message itself: nothing can be stored there
SETQQ wants a buffer, E1 to E63
%s is %s %s, not a variable
%s is a %s: it cannot be assigned
%s is a sensor: it can be read, not assigned
the counter %s of a DOTIMES cannot be assigned
SETQ wants the name of a variable or buffer
a side of DICE is a list of two: wanted (chance expr)
DOTIMES stands inside %d others: at most %d nest
the count of DOTIMES must be a whole number from 0 to %d
DOTIMES begins with its counter: wanted (name count)
%s is named twice in one LET
a binding of LET is a list of two: wanted (name expr)
LET begins with its names: wanted ((name expr) ...)
a clause of COND is a list: wanted (test expr ...)
""",
    """nested too deeply for this computer
no room for a user variable %s: there are %d already
RULE has no :priority on this computer: its rules run in the order in which they came
the cost or test of %s does something: robots that are not chosen do it too
%s is a whole command, sent once: it stands in no other expression
CANCEL stands in what is sent once: nobody has sent what is stored
""",
)


def sentence(number):
    """The sentence of this number."""
    text, at = _TEXTS[number >> 4], 0
    for _ in range(number & 15):
        at = text.find("\n", at) + 1
    return text[at : text.find("\n", at)]
