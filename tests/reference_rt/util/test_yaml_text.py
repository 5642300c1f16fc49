"""YAML: compared with ruamel.yaml's reader, which is written in Python and follows YAML 1.2."""

import math
import warnings

import pytest
import yaml
from builders import SCENES
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from reference_rt.util import yaml_text
from reference_rt.util.yaml_text import line_of

FILES = sorted([*SCENES.glob("*.yaml"), *SCENES.parent.glob("comparisons/suites/*.yaml")])

_WORDS = """
yes no on off y n Yes true True TRUE tRue false False null Null NULL ~ nUll
0 1 -1 +1 00 010 0777 09 0o10 0o8 0x1F 0x 0b11 0b2 1_000 1__0 12_345.6_7 _1
1. 1.5 .5 -.5 +.5 1e5 1E5 1e+5 1.e5 12e03 1e400 1e-400 685.230_15e+03 1.0e e5 -0 -0.0 0.10
.inf -.inf +.Inf .INF .nan .NaN -.nan . .. 1.2.3 1:30 1:30:15 190:20:30 a:b http://x -a +a - --
'yes' "1e5" '' "" "\\u00e9" "\\/" "a\\tb" a#b @ ` % * | >
"""
WORDS = _WORDS.split()
"""Scalars that YAML 1.1, YAML 1.2 and Python read in different ways, or not at all."""

TEXTS = (
    *("[a, b]", "[a,b,]", "{a: 1, b: 2}", '{"a":1,"b":[2]}', "{a}", "{a: }", "[[], {}, [{}]]"),
    *("a:\n- b\n- c", "- - - a", "- a\n-\n- b: c\n  d: e", "a:\n  b:\n    c: d\ne: f"),
    *("|\n  a\n  b", "|+\n  a\n\n", "|-\n a", ">\n a\n b\n\n c\n", '"a\n  b"', "a\n b\n\n c"),
    *("? a\n: b", "'a': 1", "{1: 2}", "{true: 1}", "{null: 2}", "a: 'x''y'", "# c", "a # c"),
    *("[&x a, *x]", "{a: &k {x: 1}, b: *k}", "{&k a: 1, b: *k}", "&a [1, &b [2], *b]"),
    *("{a: &a {x: 1}, b: {<<: *a, y: 2}}", "{a: &a {x: 1}, b: {<<: *a, x: 2}}"),
    *("{<<: [{a: 1}, {a: 2, b: 3}]}", "{<<: {a: 1}, '<<': 2}", "{b: 1, <<: {a: 1}}"),
    *("%YAML 1.2\n---\na: yes", "---\na\n...\n", "--- a", "\ufeffa: 1", "", "   ", "a: \U0001f600"),
    *("!!str 5", "!!int '3'", "!!float '3'", "!!float 1", "!!bool true", "!!null ''", "! 5"),
    *("!!seq [a]", "!!map {a: 1}", "a: !!str\nb: 1", "[a: 1, b]", "{a: {b: {c: [d, {e: f}]}}}"),
)

MALFORMED = (
    *(
        "a: &",
        "a: [1, 2",
        "a: {",
        "a: }",
        "a: ]",
        "- a\nb: c",
        "a: b: c",
        "a: 'x",
        'a: "x',
        "a: *x",
    ),
    *("a: @b", "a: `b", "\ta: 1", "a:\n\tb: 1", "{a: 1, a: 2}", "a: 1\nb: 2\na: 3", "a: \x07"),
    *("a\n---\nb", "a: !x 1", "!!python/name:os.system", "!!python/object:a.B {}", "{<<: 1}"),
    *("{<<: {a: 1}, <<: {b: 1}}", 'a: "\\q"', "a: - b", "[" * 600, "a: " + "9" * 5000, "*a"),
    *("!!int x", "!!float x", "a:\n  - b\n c", "{a: 1, 1.0: 2, 1: 3}", "%YAML 3.0\n---\na"),
)


def by_ruamel(text):
    return YAML(typ="safe", pure=True).load(text)


def same(a, b):
    """Of one type each, in one order, every bit of every number."""
    if type(a) is not type(b):
        return False
    if isinstance(a, dict):
        pairs = zip(a.items(), b.items(), strict=True)
        return len(a) == len(b) and all(same(k, m) and same(v, w) for (k, v), (m, w) in pairs)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return (a == b and math.copysign(1, a) == math.copysign(1, b)) or (a != a and b != b)
    return a == b


@pytest.mark.slow
def test_texts_read_as_ruamel_reads_them():
    for text in (*(f.read_text(encoding="utf-8") for f in FILES), *TEXTS):
        assert same(yaml_text.load(text), by_ruamel(text)), text[:99]


@pytest.mark.parametrize("shape", ["{}", "a: {}", "- {}", "[{}, b]", "a: {} # c", "{}: b"])
def test_words_read_as_ruamel_reads_them(shape):
    """Also those that are errors are errors."""
    for text in map(shape.format, WORDS):
        try:
            expected = by_ruamel(text)
        except (YAMLError, ValueError):
            with pytest.raises(yaml_text.MalformedError):
                pytest.fail(f"{text}: {yaml_text.load(text)}")
        else:
            assert same(yaml_text.load(text), expected), text


def test_malformed_texts_are_refused_with_their_line():
    """The line that ruamel tells, but where libyaml notices the end of the text one line later."""
    for text in MALFORMED:
        with pytest.raises((YAMLError, ValueError, RecursionError)):
            by_ruamel(text)
        found = []
        for before in ("", "# one\n# two\n"):
            with pytest.raises(yaml_text.MalformedError) as caught:
                pytest.fail(f"{text[:99]}: {yaml_text.load(before + text)}")
            assert "\n" not in str(caught.value)
            found.append(caught.value.line)
        assert 1 <= found[0] <= text.count("\n") + 2, text[:99]
        assert found[1] == found[0] + 2 or text.startswith("%"), text[:99]


def test_what_is_read_otherwise_than_before():
    """By the core schema: a date is text, and an exponent needs no sign."""
    assert yaml_text.load("[2001-09-09, .5e3, =]") == ["2001-09-09", 500.0, "="]
    for text in ("!!binary aGk=", "!!set {a}", "!!timestamp 2001-09-09", "[a]: b"):
        with pytest.raises(yaml_text.MalformedError):
            yaml_text.load(text)


scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(allow_nan=False),
    st.text(max_size=12),
    st.sampled_from(WORDS),
    st.text("0123456789eE.+-_xob:~ #'\"[]{},&*!|>%@`\n\t", max_size=8),
)
values = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.one_of(st.text(max_size=6), st.sampled_from(WORDS)), inner, max_size=4),
    ),
    max_leaves=12,
)


@settings(max_examples=150, deadline=None)
@given(values)
def test_what_is_dumped_is_read_again(value):
    text = yaml_text.dump(value)
    assert same(yaml_text.load(text), value)


@settings(max_examples=60, deadline=None)
@given(values, st.sampled_from([True, False, None]), st.booleans())
def test_dumps_of_ruamel_are_read_alike(value, flow, explicit):
    import io

    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = flow
    writer.explicit_start = explicit
    stream = io.StringIO()
    writer.dump(value, stream)
    text = stream.getvalue()
    try:
        expected = by_ruamel(text)
    except YAMLError:
        return  # it cannot read all that it writes
    assert same(yaml_text.load(text), expected)


# ---- lines --------------------------------------------------------------------------------------

PLACES = """\
# a scene
film: &film
  width: 4
  filter:
    type: box
shapes:
  - type: sphere
    center: [0,
             1, 2]
  - &other
    type: box
    transform:
      - scale: 2
  - *other
again: *film
"""


def by_nodes(text, keys):
    """The line of the part at `keys`, from all nodes of ruamel's."""
    node, line = YAML(typ="safe", pure=True).compose(text), 1
    for key in keys:
        if node.id == "mapping":
            found = [(k, v) for k, v in node.value if k.value == str(key)]
            if not found:
                break
            line, node = found[0][0].start_mark.line + 1, found[0][1]
        elif node.id == "sequence" and isinstance(key, int) and key < len(node.value):
            node = node.value[key]
            line = node.start_mark.line + 1
        else:
            break
    return line


def test_lines():
    for keys in (
        *((), ("film",), ("film", "width"), ("film", "filter", "type"), ("film", "no"), ("no",)),
        *(("shapes", 0, "type"), ("shapes", 0, "center"), ("shapes", 0, "center", 2)),
        *(("shapes", 1, "transform", 0, "scale"), ("shapes", 9), ("shapes", "type")),
        *(("shapes", 1), ("shapes", 0, "type", "deeper"), ("film", 0)),
    ):
        assert line_of(PLACES, keys) == by_nodes(PLACES, keys), keys


def test_lines_behind_aliases():
    """The line of the alias for itself, and of what it names for what is inside."""
    assert line_of(PLACES, ("again",)) == 15
    assert line_of(PLACES, ("again", "filter", "type")) == 5
    assert line_of(PLACES, ("shapes", 2)) == 14
    assert line_of(PLACES, ("shapes", 2, "transform", 0)) == 13
    assert line_of("a: \x07", ("a",)) is None


def test_lines_of_every_key_of_a_scene():
    text = (SCENES / "cornell_box.yaml").read_text(encoding="utf-8")

    def places(value, *keys):
        yield keys
        if isinstance(value, dict | list):
            for key, item in value.items() if isinstance(value, dict) else enumerate(value):
                yield from places(item, *keys, key)

    for keys in list(places(yaml_text.load(text)))[::7]:
        assert line_of(text, keys) == by_nodes(text, keys)


# ---- bounds -------------------------------------------------------------------------------------


def test_aliases_are_counted_by_what_they_stand_for(monkeypatch):
    monkeypatch.setattr(yaml_text, "MOST_REPEATED", 12)
    assert len(yaml_text.load("[&a [x, y, z], *a, *a, *a]")) == 4
    for text in (
        "[&a [x, y, z], *a, *a, *a, *a]",
        "{a: &a {x: 1}, b: &b [*a, *a], c: [*b, *b]}",  # 6 and 14
        "[&a x" + ", *a" * 13 + "]",
        "{a: &a {x: 1, y: 2}, b: {<<: *a}, c: {<<: [*a, *a]}}",
    ):
        with pytest.raises(yaml_text.MalformedError, match="more than 12 values"):
            yaml_text.load(text)


@pytest.mark.parametrize("parser", [yaml_text.Parser, yaml.BaseLoader])
def test_nesting_is_bounded(parser, monkeypatch):
    monkeypatch.setattr(yaml_text, "Parser", parser)
    deep = yaml_text.MOST_NESTED
    too_deep = (deep + 1,)
    # JSON's limit is Python's, which differs between its versions.
    for begin, end, bad in (
        *(("[", "]", too_deep), ("{a: ", "}", too_deep), ("- ", "", too_deep)),
        ('{"a":', "}", (deep * 2000,)),
    ):
        assert yaml_text.load_any(begin * deep + "1" + end * deep)
        for n in bad:
            with pytest.raises(yaml_text.MalformedError, match="nested too deeply") as raised:
                yaml_text.load_any(begin * n + "1" + end * n)
            assert raised.value.line == 1


@pytest.fixture(autouse=True)
def _no_warnings_of_ruamel():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
