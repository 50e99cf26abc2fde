"""The parser: every form of a line, the slips that real programs make, and errors that say where and what."""

from __future__ import annotations

import random
import re
import time
from pathlib import Path

import pytest

from interfaces.val2 import forms
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.parser import LONGEST_LINE, cached_step, parse_expression, parse_line
from interfaces.val2.printer import print_step
from interfaces.val2.source import parse_file, parse_program
from interfaces.val2.structure import survey
from interfaces.val2.syntax import (
    BLANK,
    Apply,
    Format,
    Instruction,
    Number,
    Text,
    Variable,
)

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.v2"))


def attempt(parse, *arguments):
    """What parsing gives, or its error."""
    try:
        return parse(*arguments), None
    except ValError as error:
        return None, error


def number(value):
    return Number(float(value))


def name(text):
    return Variable(text)


def statement(text):
    return parse_line(text).statement


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        ("MOVE p1", Instruction("MOVE", (name("p1"),))),
        ("moves #safe", Instruction("MOVES", (name("#safe"),))),
        ("MOVET p,TRUE", Instruction("MOVET", (name("p"), Apply("TRUE")))),
        ("APPROS p[1], 50", Instruction("APPROS", (Variable("p", (number(1),)), number(50)))),
        ("DEPART -50", Instruction("DEPART", (Apply("-", (number(50),)),))),
        ("DRIVE 3,40,50", Instruction("DRIVE", (number(3), number(40), number(50)))),
        ("DRAW ,,10", Instruction("DRAW", (None, None, number(10)))),
        ("SPEED 30", Instruction("SPEED", (number(30),))),
        ("SPEED 30 MMPS ALWAYS", Instruction("SPEED", (number(30),), ("MMPS", "ALWAYS"))),
        ("SPEED 20 ips, 30 always", Instruction("SPEED", (number(20), number(30)), ("IPS", "ALWAYS"))),
        ("SPEED 50 MONITOR", Instruction("SPEED", (number(50),), ("MONITOR",))),
        ("COARSE ALWAYS", Instruction("COARSE", (), ("ALWAYS",))),
        ("FINE 50 ALWAYS", Instruction("FINE", (number(50),), ("ALWAYS",))),
        ("NONULL", Instruction("NONULL")),
        ("TOOL", Instruction("TOOL")),
        ("TOOL NULL", Instruction("TOOL", (Apply("NULL"),))),
        ("BASE 1,,3", Instruction("BASE", (number(1), None, number(3)))),
        ("ENABLE CP, dry.run", Instruction("ENABLE", (), ("CP", "DRY.RUN"))),
        ("PARAMETER hand.time = 0.5", Instruction("PARAMETER", (number(0.5),), ("HAND.TIME",))),
        ("TIMER 1 = 0", Instruction("TIMER", (number(1), number(0)))),
        ("SIGNAL 1,-2", Instruction("SIGNAL", (number(1), Apply("-", (number(2),))))),
        ("WAIT", Instruction("WAIT")),
        ("ALTER (1) 3", Instruction("ALTER", (number(1), number(3)))),
        ("ALTER () 1, 3", Instruction("ALTOUT", (number(1), number(3)))),
        ("ALTOUT 0,0,1,0,0,0", Instruction("ALTOUT", tuple(map(number, (0, 0, 1, 0, 0, 0))))),
        ("AT 3.5", Instruction("AT", (number(3.5),))),
        ("GRASP 20, 90", Instruction("GRASP", (number(20), number(90)))),
        ("HERE a:b", statement("here A:B")),
        ("x = 3", Instruction("=", (name("x"), number(3)))),
        ('$s[2] = "a;b"', Instruction("=", (Variable("$s", (number(2),)), Text("a;b")))),
        ("SET p = NULL", Instruction("SET", (name("p"), Apply("NULL")))),
        ("p = TRANS(1,,3)", Instruction("SET", (name("p"), Apply("TRANS", (number(1), None, number(3)))))),
        (
            "SHIFT p BY 1,,3",
            Instruction("SET", (name("p"), Apply("SHIFT", (name("p"), number(1), None, number(3))))),
        ),
        ("DECOMPOSE a[1] = p", Instruction("DECOMPOSE", (Variable("a", (number(1),)), name("p")))),
        ("IF a THEN", Instruction("IF", (name("a"),))),
        ("IF a GOTO 10", Instruction("IF", (name("a"), number(10)))),
        ("FOR i = 1 TO n STEP 2", Instruction("FOR", (name("i"), number(1), name("n"), number(2)))),
        ("VALUE 1, -2:", Instruction("VALUE", (number(1), Apply("-", (number(2),))))),
        ("EXIT 2", Instruction("EXIT", (number(2),))),
        (
            "CALL a.b(x, , y[])",
            Instruction("CALL", (name("x"), None, Variable("y", array=True)), program="a.b"),
        ),
        ("GOSUB sub", Instruction("GOSUB", program="sub")),
        ("REACT 1001, halt.it ALWAYS", Instruction("REACT", (number(1001),), ("ALWAYS",), program="halt.it")),
        ("REACTI -1001", Instruction("REACTI", (Apply("-", (number(1001),)),))),
        ('TYPE "x =", x, /F8.2, /S', Instruction("TYPE", (Text("x ="), name("x"), Format("F", 8, 2), Format("S")))),
        ('PROMPT "n? ", n, $s', Instruction("PROMPT", (Text("n? "), name("n"), name("$s")))),
        ("AUTO REAL q[6], r", Instruction("AUTO", (Variable("q", (number(6),)), name("r")), ("REAL",))),
    ],
)
def test_forms_of_lines(text, tree):
    assert statement(text) == tree


def test_a_line_has_a_label_a_comment_and_places():
    step = parse_line("\t100  MOVES a:b ; there;and back ")
    assert (step.label, step.comment, step.at) == (100, " there;and back", TextPosition(1, 7))
    (operand,) = step.statement.operands
    assert (operand.at, operand.parts[1].at) == (TextPosition(1, 13), TextPosition(1, 15))
    assert parse_line("") == parse_line("   \t")
    assert parse_line("").statement == BLANK
    assert parse_line("7 ;x").label == 7
    assert (parse_line(" 7 #a = #b").at, parse_line(" # a").at) == (TextPosition(1, 4), TextPosition(1, 1))
    assert parse_line("REMARK it's \"so; or").comment == "it's \"so; or"
    program = parse_program("\n.PROGRAM p\r\n x = 1\r  y = -\t2\n.END")
    assert program.steps[1].statement.operands[1].at == TextPosition(4, 7)


SLIPS = [
    ("END l5", "END ;l5"),
    ("END l5 ;x", "END ;l5 ;x"),
    ("SET #a = PPOINT(1,2)", "SET #a = #PPOINT(1, 2)"),
    ("SIGNAL (-out.x)", "SIGNAL -out.x"),
    ("WAIT.EVENT, 1", "WAIT.EVENT , 1"),
    ("WAIT.EVENT , t", "WAIT.EVENT , t"),
    ("AUTO REAL jts[10]", "AUTO REAL jts[10]"),
    ("auto double x", "AUTO REAL x"),
    ("\tMove\tP1\t;x", "MOVE p1 ;x"),
    ("VALUE 1:", "VALUE 1:"),
    ("VALUE 1", "VALUE 1:"),
    ("VALUE 1 : ;x", "VALUE 1: ;x"),
    ("ANY:", "ANY"),
    ("MOVE(a)", "MOVE a"),
    ("WHILE x < 3", "WHILE x < 3 DO"),
    ("IF x", "IF x THEN"),
    ("IF x EQ 1 THEN 20", "IF x == 1 GOTO 20"),
    ("IF x=1 THEN GOTO 20", "IF x == 1 GOTO 20"),
    ("CASE x", "CASE x OF"),
    ('SPEED 100, "MONITOR"', "SPEED 100 MONITOR"),
    ("ACCEL (1) 80, 60", "ACCEL 80, 60"),
    ("WAIT 3", "WAIT SIG(1003)"),
    ("WAIT -1003", "WAIT SIG(-1003)"),
    ("WAIT 33", "WAIT SIG(1033)"),
    ("sig 1,-2", "SIGNAL 1, -2"),
    ('10 TY "a" ;b', '10 TYPE "a" ;b'),
    ("GOT 10", "GOTO 10"),
    ("wh a", "WHILE a DO"),
    ("gos part", "GOSUB part"),
    ("AT 3 ALI", "AT 3 ALIGN"),
    ("sig = 3", "sig = 3"),
    ("sig[1] = 3", "sig[1] = 3"),
    ("TYPE sig", "TYPE sig"),
    ("bits 1 = 1", "BITS 1 = 1"),
    ("bits a[1],(n+1)=x==2", "BITS a[1], (n + 1) = x == 2"),
    ("MOVE SHIFT(HERE BY -20)", "MOVE SHIFT(HERE BY -20)"),
    ("DECOMPOSE tmp[] = HERE", "DECOMPOSE tmp[] = HERE"),
    ("BREAK;", "BREAK ;"),
    ("1. MOVE p ;x", "MOVE p ;x"),
    ("  2.?  10 x = 1 # y", "10 x = 1 ; y"),
    ("# why", "; why"),
    ("#why", ";why"),
    ("  20 #why not", "20 ;why not"),
    ("#why, it's = 3", ";why, it's = 3"),
    ("MOVE #a #why", "MOVE #a ;why"),
    ("TYPE 1 #one", "TYPE 1 ;one"),
    ("#a = #b", "SET #a = #b"),
    ('TYPE "#1"', 'TYPE "#1"'),
    ("x = +3", "x = 3"),
    ("x = a => b", "x = a >= b"),
    ("value[0] = step", "value[0] = step"),
    ("FOR to = by TO step STEP of", "FOR to = by TO step STEP of"),
    ("exit.loop = TRUE", "exit.loop = TRUE"),
    ("a_very_long_name_indeed = 1", "a_very_long_nam = 1"),
    ("CALL prog", "CALL prog()"),
    ("ENABLE COLOR.SPEED", "ENABLE COLOR.SPEED"),
]


@pytest.mark.parametrize(("text", "printed"), SLIPS)
def test_slips_are_survived(text, printed):
    assert print_step(parse_line(text)) == printed


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("head", [".PROGRAM p()", ".program P", ".Program p ( ) ;x"])
@pytest.mark.parametrize("last", [".END", ".end ", ""])
def test_heads_ends_and_line_ends(ends, head, last):
    program = parse_program(ends.join(["; of the file", head, "", " move a", "end", last]))
    blank, move, end = (step.statement for step in program.steps)
    assert (program.name, blank, end) == ("p", BLANK, Instruction("END"))
    assert move.keyword == "MOVE"


def test_what_has_no_meaning_is_kept_as_it_is_written():
    assert statement('FSET (lun, 4) "SERIAL:1" ;x') == Instruction("FSET", passed='(lun, 4) "SERIAL:1"')
    assert statement("weave 3,1") == Instruction("WEAVE", passed="3,1")
    assert statement("PARAMETER not.ours = 3") == Instruction("PARAMETER", passed="not.ours = 3")
    assert all(statement(keyword).passed is not None for keyword in forms.IGNORED)


def test_words_are_keywords_only_where_they_can_stand():
    for word in ("speed", "move", "then", "always", "end", "for", "value"):
        assert statement(f"{word} = {word} + 1") == statement(f"{word}= {word}+1")
        assert statement(f"{word} = 1").keyword == "="
    assert statement("WHILE do DO") == Instruction("WHILE", (name("do"),))


@pytest.mark.parametrize(
    ("text", "column", "said"),
    [
        ("MOVE", 5, "*Missing argument* location; allowed: MOVE location"),
        ("MOVE p, 2", 9, "*Too many arguments* allowed: MOVE location"),
        ("  MOVE )", 8, "unexpected ')'; allowed: MOVE location"),
        ("MOVE p ALWAYS", 8, "unexpected 'ALWAYS'; allowed: MOVE location"),
        ("APPRO a", 8, "distance; allowed: APPRO location, distance"),
        ("SPEED 10 MMPS IPS", 15, "one of MMPS, IPS, MONITOR"),
        ("SIG", 4, "*Missing argument* number; allowed: SIGNAL number, .."),
        ("SI 1", 1, "*Ambiguous instruction* SI: SIGNAL, SINGLE"),
        ("OPE", 1, "*Ambiguous instruction* OPE: OPEN, OPENI"),
        ("#a == #b", 4, "'==' compares, '=' assigns"),
        ("MOV p", 1, "*Ambiguous instruction* MOV: MOVE, MOVES, MOVEST, MOVET"),
        ("MOOV p", 1, "*Undefined instruction* MOOV; did you mean MOVE?"),
        ("TIME x", 1, "*Undefined instruction* TIME; did you mean TIMER?"),
        ("GRA 3 4", 7, "unexpected '4'; allowed: GRASP opening[, label]"),
        ("MVOE p", 1, "*Undefined instruction* MVOE; did you mean MOVE?"),
        ("10 x == 3", 6, "'==' compares, '=' assigns"),
        ("x = sine(3)", 5, "*Undefined function* SINE; did you mean SIN?"),
        ("x = TRANS(1,2,3,4,5,6,7)", 5, "*Too many arguments* allowed: TRANS(["),
        (
            "BITS 1, 2",
            10,
            "unexpected the end of the line; allowed: ',', ':', '='; form: BITS first[, count] = value",
        ),
        ("SET p = SCALE(a)", 9, "*Missing argument* factor; allowed: SCALE(a BY factor)"),
        ("SET p = INVERSE(a BY 2)", 19, "BY belongs in SHIFT and SCALE"),
        ("SET tool = NULL", 5, "*Reserved name* TOOL is a function"),
        ("x = ATAN2(1)", 5, "*Missing argument* x; allowed: ATAN2(y, x)"),
        ("x = (1 + 2", 11, "unexpected the end of the line"),
        ("x = 1 2", 7, "unexpected '2'; allowed: an operator"),
        ("x = ", 4, "allowed: a value"),
        ("x = a @ b", 7, "unexpected '@'"),
        ('TYPE "a", "b', 11, "no closing quote"),
        ("TYPE /Q3", 6, "*Invalid format* /Q3; allowed: /B"),
        ("x = MAX(/F8.2)", 9, "belongs in TYPE and $ENCODE"),
        ("pi = 3", 1, "*Reserved name* PI"),
        ("FOR HERE = 1 TO 3", 5, "*Reserved name* HERE"),
        ("FOR i = 1", 10, "unexpected the end of the line"),
        ("70000 MOVE a", 1, "*Invalid label* allowed: 0 to 65535"),
        ("GOTO 65536", 6, "*Invalid label*"),
        ("IF a GOTO x", 11, "allowed: a number"),
        ("ELSEIF x", 1, "ELSE on a line"),
        ("BREAK 3", 7, "*Too many arguments* allowed: BREAK"),
        ("RETURN 1, 2", 11, "*Too many arguments* allowed: RETURN [skipped]"),
        ("CALL 3", 6, "allowed: the name of a program"),
        ("CALL #p", 6, "the name of a program"),
        ("REACT 1001, $x", 13, "the name of a program"),
        ('PROMPT "x", 3', 13, "allowed: a variable"),
        ("PARAMETER HAND.TIME", 20, "allowed: '='; form: PARAMETER name = value"),
        ("x = 1E999", 5, "*Number too large* 1E999"),
        ("x = a AND OR", 11, "OR can't stand here"),
        ("%", 1, "unexpected '%'"),
        (".FOO", 1, "unexpected '.'"),
    ],
)
def test_errors_say_where_and_what_is_allowed(text, column, said):
    with pytest.raises(ValError) as caught:
        parse_line(text)
    assert said in str(caught.value)
    assert caught.value.place == TextPosition(1, column)


def test_errors_in_programs_have_the_line_of_the_file():
    with pytest.raises(ValError) as caught:
        parse_program("\n\n.PROGRAM p\n MOVE a\n\n  MOVE )\n.END")
    assert caught.value.place == TextPosition(6, 8)
    assert caught.value.program == "p"
    for text, place in (
        (".PROGRAM", (1, 9)),
        (".PROGRAM a(b", (1, 13)),
        (".PROGRAM a(b c)", (1, 14)),
        ("MOVE a", (1, 1)),
    ):
        with pytest.raises(ValError) as caught:
            parse_program(text)
        assert caught.value.place == TextPosition(*place)
    for text, what in ((".PROGRAM a(b, b)", "Duplicate name"), (".PROGRAM a(pi)", "Reserved name")):
        with pytest.raises(ValError, match=what):
            parse_program(text)
    with pytest.raises(ValError, match="one program"):
        parse_program(".PROGRAM a\n.END\n.PROGRAM b\n.END")
    with pytest.raises(ValError, match=r"Undefined directive\* \.ENDE; did you mean \.END\?"):
        parse_program(".PROGRAM a\n.ENDE")


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "(" * 400 + "1" + ")" * 400,
        "x = " + "-" * 900 + "1",
        "x = " + "NOT " * 200 + "1",
        "x = " + "+".join("1" * 450),
        "x = " + "ABS(" * 200,
        "x = " + "ABS(" * 190 + "1" + ")" * 190,
        "MOVE " + ":".join("a" * 450),
        "TYPE " + ",".join("a" * 450),
        "x = " + "a[" * 300 + "1" + "]" * 300,
        "x" * 2000,
        "x = " + "9" * 900,
    ],
)
def test_absurd_lines_are_trees_or_errors(text):
    step, error = attempt(parse_line, text)
    if error is None:
        assert parse_line(print_step(step)) == step
    else:
        assert error.place is not None
    assert LONGEST_LINE < 2000


TOKENS = ["MOVE ", "TRANS(", "SHIFT(p BY ", "NOT ", "-", " ALWAYS", "END", "IF ", "\n.END\n", "\n.PROGRAM a\n", '"']
TOKENS += [
    "((((",
    "1E999",
    "/F8.2",
    "[",
    "]",
    ",",
    " AND ",
    "65536 ",
    "^HFFF",
    "\n.LOCATIONS\n",
    "\n.SIGNALS\n",
    ";",
]
CHARACTERS = 'ABCxyz019 .,:;"()[]=<>+-*/^#$_\t\n\r\x00\x0b\x85\u2028\u017f\u212a\xa0²é{}'


def mutated(text, rng):
    """A text with one to three mutations."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        i = rng.randrange(len(text) + 1)
        j = min(len(text), i + rng.choice([0, 1, 1, 2, 5]))
        match rng.randrange(5):
            case 0:
                text = text[:i] + rng.choice(CHARACTERS) + text[i:]
            case 1:
                text = text[:i] + text[j:]
            case 2:
                text = text[:i] + rng.choice(TOKENS) * rng.choice([1, 1, 1, 3, 30]) + text[i:]
            case 3:
                text = text[:i] + text[i:j] * rng.choice([2, 50]) + text[j:]
            case _:
                k = rng.randrange(len(text) + 1)
                text = text[:i] + text[k : k + rng.randrange(20)] + text[j:]
    return text


def test_mutated_programs_are_programs_or_val_errors():
    rng = random.Random(20)
    originals = [path.read_bytes().decode() for path in PROGRAMS]
    read = 0
    for _ in range(10_000):
        text = mutated(rng.choice(originals), rng)
        source, error = attempt(parse_file, text, "m.v2")
        if error is None:
            read += 1
            for program in source.programs:
                survey(program)
        else:
            assert error.place.line >= 1
            assert error.place.column >= 1
    assert 1000 < read < 9000


def test_mutated_lines_are_steps_or_val_errors():
    rng = random.Random(21)
    lines = [line for path in PROGRAMS for line in path.read_bytes().decode().splitlines() if line.strip()]
    read = 0
    for _ in range(10_000):
        text = mutated(rng.choice(lines), rng)
        for parse in (parse_line, parse_expression):
            tree, error = attempt(parse, text)
            if error is not None:
                assert error.place.line == 1
                assert 1 <= error.place.column <= len(text) + 1
                continue
            read += 1
            if parse is parse_line:
                assert parse_line(print_step(tree)) == tree
    assert 1000 < read < 19_000


@pytest.mark.parametrize(
    "text",
    [
        "TRANS(1, -2.5,\t3. ,4,5,-06)",
        "#ppoint (0,-90,90,0,0,0)",
        "PPOINT(0,-90,90,0,0,0)",
        "ATAN2(1,2)",
        "RZ(-45.125)",
    ],
)
def test_calls_with_numbers_alone_are_what_the_grammar_makes_of_them(text):
    (quick,) = statement(f"MOVE {text}").operands
    slow = parse_expression(f"     {text}")
    assert quick == slow
    assert quick.at == slow.at
    for left, right in zip(quick.arguments, slow.arguments, strict=True):
        assert left.at == right.at
        if isinstance(left, Apply):
            assert left.arguments[0].at == right.arguments[0].at


def test_a_long_program_is_read_quickly():
    kinds = [
        "MOVE p[{i}]",
        "x = x + {i} * SIN({i}.5) - y",
        "IF x > {i} AND SIG(1001) THEN ;c",
        "MOVES SHIFT(p{i} BY 0,0,{i}):b",
        "END",
        'TYPE "x =", x, /F8.2, {i}',
        "SET a = TRANS({i},200,300,90,0,0):RZ(45)",
        "CALL foo(a, {i}, x[])",
    ]
    text = ".PROGRAM p\n" + "\n".join(kinds[i % len(kinds)].format(i=i) for i in range(1000))
    parse_program(text)
    took = []
    for _ in range(5):
        cached_step.cache_clear()
        begin = time.process_time()
        parse_program(text)
        took.append(time.process_time() - begin)
    assert min(took) < 0.5


def refusal(line):
    """Why a line can't be one; empty where it can."""
    try:
        parse_line(line)
    except ValError as error:
        return str(error)
    return ""


def test_what_is_allowed_is_never_nothing():
    """Every beginning of a line may be followed by something, the end of the line at least."""
    words = '5 NULL x ) ( @ = == ALWAYS THEN TO BY GOTO /S / "a" " , [ ] a[1] $s #p MOD - NOT : STEP TRANS( ^ 1E'
    rng = random.Random(7)
    for keyword in (*forms.INSTRUCTIONS, "x =", "SET p =", ""):
        for count in range(1, 5):
            line = " ".join([keyword, *rng.choices(words.split(), k=count)])
            assert not re.search(r"allowed: ?(,|$)|unexpected [^;]*$", refusal(line)), line


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("30 ALWAYS", "an operator, ':', the end of the line"), ("30 )", "an operator, ':', the end of the line"),
        ("NULL NULL", "an operator, '(', ':', '[', the end of the line"), ("(30", "an operator, ')', ':'"),
    ],
)  # fmt: skip
def test_what_is_allowed_behind_an_expression(text, allowed):
    with pytest.raises(ValError, match=re.escape(f"allowed: {allowed}, line 1")):
        parse_expression(text)
