import pytest

from testbench.readers.csv.dialect import UnclearDialect, detect_dialect

CASES = {
    "comma": ("t,a\n0.1,2.5\n0.2,2.6", ",", "."),
    "semicolon, decimal comma": ("t;a\n0,1;2,5\n0,2;2,6", ";", ","),
    "semicolon, decimal point": ("t;a\n0.1;2.5\n0.2;2.6", ";", "."),
    "tab, decimal comma": ("t\ta\n0,1\t2,5\n0,2\t2,6", "\t", ","),
    "blanks, decimal comma": ("t a\n0,1  2,5\n0,2  2,6", " ", ","),
    "commas with blanks": ("t, a\n0.1, 2.5\n0.2, 2.6", ",", "."),
    "integers": ("i,n\n1,2\n3,4", ",", "."),
    "one column": ("t_us\n10\n20", "", "."),
    "one column, decimal comma": ("a (g)\n0,5\n0,7", "", ","),
    "quoted, decimal comma": ('"t","a"\n"0,1","2,5"\n"0,2","2,6"', ",", ","),
    "comments above": ("# 16 g, 3 axes, x\nt;a\n0,1;2,5", ";", ","),
    "preamble above": ("Device, model: X, Y\nt;a\n0,1;2,5\n0,2;2,6", ";", ","),
}


@pytest.mark.parametrize("case", CASES)
def test_dialects_of_loggers(case: str) -> None:
    """Delimiter and decimal mark are told from the first lines."""
    text, delimiter, decimal = CASES[case]
    found = detect_dialect(text.split("\n"))
    assert (found.delimiter, found.decimal, found.doubt) == (delimiter, decimal, "")


@pytest.mark.parametrize("text", ["10,13\n11,14\n12,15", "a,b\n0,5,1,2\n0,6,1,3", "1,-0,251\n2,1,063\n3,2,5"])
def test_commas_of_two_meanings_are_refused(text: str) -> None:
    """Commas that may be delimiters or decimal marks are not guessed."""
    with pytest.raises(UnclearDialect, match="commas may part the columns or be decimal marks"):
        detect_dialect(text.split("\n"))


def test_three_digits_behind_every_mark_are_doubted() -> None:
    """If every number may as well carry a mark of thousands, that is said."""
    assert "three digits" in detect_dialect(["t;a", "1;1,234", "2;5,678"]).doubt
    assert detect_dialect(["t;a", "1;1,234", "2;0,678"]).doubt == ""


def test_the_person_has_the_last_word() -> None:
    """What is given is not detected."""
    found = detect_dialect(["10,13", "11,14"], delimiter="", decimal=",")
    assert (found.delimiter, found.decimal) == ("", ",")


def test_a_quote_that_is_never_closed_is_refused() -> None:
    """An opening quote without its end would swallow the comma between two columns and make 0,5 of them 0.5."""
    with pytest.raises(UnclearDialect, match="a quote is opened and not closed"):
        detect_dialect(['"Time (s),A (g)', "0,5", "1,7", "2,4"])
