"""Promises of the reader of `.wbt` text: every quirk of the format, errors in place."""

import random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from world_texts import EVERYTHING, OLD, mutated, text

from tdac_envs import write_world
from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.wbt.content import MOST_PARTS
from tdac_envs.worlds.wbt.reader import LARGEST_FILE, load_world, read_world
from tdac_envs.worlds.wbt.tree import DEEPEST, MOST_NODES, WbtNode, parse
from tdac_envs.worlds.world import World


def only(content: str) -> WbtNode:
    """The one node after the WorldInfo."""
    nodes = parse(text(content), "w.wbt").nodes
    assert len(nodes) == 2
    return nodes[1]


def items(content: str, field: str = "a"):
    return only(f"Foo {{ {content} }}").fields[field].items


@pytest.mark.parametrize(
    ("header", "version", "release"),
    [
        ("#VRML_SIM R2025a utf8", "R2025a", (2025, 1)),
        ("#VRML_SIM R2019b-rev1 utf8", "R2019b-rev1", (2019, 2)),
        ("#VRML_SIM V8.6 utf8", "V8.6", (8, 6)),
        ("#VRML_SIM V7.2.5 utf8", "V7.2.5", (7, 2)),
        ("#VRML_SIM V6.0 utf8", "V6.0", (6, 0)),
        ("#VRML_OBJ V7.1.2", "V7.1.2", (7, 1)),
        ("#VRML V2.0 utf8", "V2.0", (2, 0)),
        ("#VRML_SIM R2022a", "R2022a", (2022, 1)),
        ("\ufeff#VRML_SIM R2022a utf8  ", "R2022a", (2022, 1)),
    ],
)
def test_headers_of_all_versions(header, version, release):
    """Any header of Webots is read, and releases can be compared."""
    document = parse(header + "\nWorldInfo { }", "w.wbt")
    assert (document.version, document.release) == (version, release)
    assert [node.kind for node in document.nodes] == ["WorldInfo"]


@pytest.mark.parametrize(
    "header",
    ["", "WorldInfo { }", "#VRML_SIM", "# VRML_SIM R2025a utf8", "#VRML_SIM x"],
)
def test_a_file_without_header_is_no_world(header):
    """It says what the first line should be."""
    with pytest.raises(WorldError, match="line 1, column 1: expected a header"):
        parse(header, "w.wbt")


def test_values_of_all_types():
    """A value is a run of numbers, a string, a constant, a node, or a list of these."""
    assert items("a 1 -2.5 +3 .5 1e-3 b 0") == (1.0, -2.5, 3.0, 0.5, 1e-3)
    assert items('a "x y"') == ("x y",)
    assert items("a TRUE") == (True,)
    assert items("a FALSE b 1") == (False,)
    assert items("a NULL") == (None,)
    assert items('a [ "x" "y" ]') == ("x", "y")
    assert items("a [ 1 2 3 ]") == (1.0, 2.0, 3.0)
    assert items("a [ ]") == ()
    assert [node.kind for node in items("a [ Bar { } Bar { } ]")] == ["Bar", "Bar"]
    (inner,) = items("a Bar { c 1 }")
    assert inner.fields["c"].items == (1.0,)


def test_commas_are_white_space():
    """Webots takes commas for blanks, anywhere."""
    assert items("a 1, 2,,3,") == (1.0, 2.0, 3.0)
    assert len(items("a [ 0, 1, 2, -1, ]")) == 4


def test_brackets_need_no_blanks():
    """Punctuation ends a word by itself."""
    assert items("a[1 2]") == (1.0, 2.0)
    assert only('Foo{name"x"children[Bar{}Baz{}]}').fields["name"].items == ("x",)


def test_comments_run_to_the_end_of_the_line():
    """Also in nodes and lists; a # in a string is a character."""
    assert items("a [ 1 # 2 } ]\n 3 ]") == (1.0, 3.0)
    assert items('a "# no comment" # } "\n') == ("# no comment",)
    assert only("# é ü 東\nFoo { }").kind == "Foo"


def test_escapes_in_strings():
    """A backslash keeps a quote or a backslash, and n breaks the line."""
    assert items(r'a "say \"hi\" \\ there\n"') == ('say "hi" \\ there\n',)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends_of_all_systems(end):
    """LF, CR LF and CR end a line, in comments and for the place of an error too."""
    lines = ["#VRML_SIM V6.0 utf8", "# a comment", "Foo {", "  a 1 # b", "  b ]", "}"]
    with pytest.raises(WorldError, match="line 5, column 5: expected a value of b"):
        parse(end.join(lines), "w.wbt")


def test_names_may_hold_hyphens_and_more():
    """`E-puck`, `BB-8` and `DEF E-PUCK` are ordinary names."""
    node = only("DEF E-PUCK(1) E-puck { }")
    assert (node.kind, node.define) == ("E-puck", "E-PUCK(1)")
    assert parse(text("DEF a:b BB-8 { }"), "w.wbt").nodes[1].kind == "BB-8"


def test_extern_protos_are_passed_over():
    """With and without IMPORTABLE, at the top and between nodes."""
    content = text(
        'EXTERNPROTO "https://example.org/E-puck.proto"',
        'IMPORTABLE EXTERNPROTO "webots://a/Rock.proto"',
        "Foo { }",
        'EXTERNPROTO "../protos/Bar.proto"',
        "Bar { }",
    )
    assert [n.kind for n in parse(content, "w.wbt").nodes[1:]] == ["Foo", "Bar"]


def test_hidden_fields_are_passed_over():
    """Whatever their value is; a field of the same name stays."""
    node = only("Foo { hidden a 1 2 3 hidden b Bar { } a 5 hidden a [ 1 ] c TRUE }")
    assert {name: f.items for name, f in node.fields.items()} == {
        "a": (5.0,),
        "c": (True,),
    }


def test_use_is_the_latest_definition_above():
    """A DEF may be redefined; USE takes the last one before it."""
    nodes = parse(
        text(
            "DEF A Foo { a 1 }",
            "Bar { c USE A }",
            "DEF A Foo { a 2 }",
            "Bar { c USE A }",
        ),
        "w.wbt",
    ).nodes
    values = [nodes[k].fields["c"].items[0].fields["a"].items for k in (2, 4)]
    assert values == [(1.0,), (2.0,)]


def test_a_definition_within_one_of_the_same_name_is_the_later():
    """As in Webots: the outer one was begun before."""
    nodes = parse(text("DEF A Foo { c DEF A Bar { } }", "USE A"), "w.wbt").nodes
    assert nodes[2].kind == "Bar"


def test_unknown_nodes_and_fields_are_kept():
    """Nothing that is well formed is thrown away."""
    node = only(
        "LegoTallWall { flavour [ Spice { } ] extensionSlot1 1 2 textureUrl [] }"
    )
    assert list(node.fields) == ["flavour", "extensionSlot1", "textureUrl"]


BROKEN = {
    "Foo {": (2, 6, "expected a field of Foo or '}', got the end of the file"),
    "Foo { a 1 ] }": (2, 11, r"expected a field of Foo or '}', got ']'"),
    "Foo { a [ 1 2": (2, 14, "expected a value of a or ']', got the end"),
    "Foo { a [ [ 1 ] ] }": (2, 11, "expected a value of a or ']', got '\\['"),
    "Foo { a }": (2, 9, "expected a value of a, got '}'"),
    "Foo { a Bar }": (2, 13, "expected '{' after Bar, got '}'"),
    "Foo\n{ a 1.2.3 }": (3, 5, "expected a number, got '1.2.3'"),
    "Foo { a 1e999 }": (2, 9, "expected a number, got '1e999'"),
    "Foo { a 1_0 }": (2, 9, "expected a number, got '1_0'"),
    'Foo { a "x\ny" }': (2, 9, "a string is not closed on its line"),
    "Foo { a USE B }": (2, 13, "USE B: there is no DEF B before it"),
    "USE A\nDEF A Foo { }": (2, 5, "USE A: there is no DEF A before it"),
    "DEF A Foo { c USE A }": (2, 19, "USE A: there is no DEF A before it"),
    "DEF": (2, 4, "expected a name after DEF, got the end of the file"),
    "DEF TRUE Foo { }": (2, 5, "expected a name after DEF, got 'TRUE'"),
    "{ }": (2, 1, "expected a node, got '{'"),
    "}": (2, 1, "expected a node, got '}'"),
    "Foo { TRUE 1 }": (2, 7, "expected a field of Foo, got TRUE"),
    "Foo { a IS b }": (2, 9, "IS is allowed only in .proto files"),
    "Foo { hidden }": (2, 14, "expected a field after 'hidden', got '}'"),
    "EXTERNPROTO Foo { }": (2, 17, "expected the URL of a PROTO in quotes, got '{'"),
    "IMPORTABLE Foo { }": (2, 12, "expected EXTERNPROTO after IMPORTABLE"),
    "# é\n\n   ?": (4, 5, "expected '{' after ?"),
}


@pytest.mark.parametrize("content", BROKEN)
def test_a_broken_file_says_where(content):
    """One line with file, line and column, and what was expected."""
    line, column, message = BROKEN[content]
    with pytest.raises(WorldError) as caught:
        parse("#VRML_SIM R2025a utf8\n" + content, "w.wbt")
    said = str(caught.value)
    assert said.startswith(f"w.wbt, line {line}, column {column}: ")
    assert message.replace("\\", "") in said
    assert "\n" not in said


WRONG = {
    "WoodenBox { size 1 2 }": "18: expected 3 numbers for size of WoodenBox",
    'WoodenBox { size "x" }': "18: expected 3 numbers for size of WoodenBox",
    "Solid { name 3 }": "14: expected a string for name of Solid",
    "Solid { boundingObject 3 }": "24: expected nodes for boundingObject of Solid",
    "Solid { boundingObject [ Box { } Box { } ] }": "expected one node for boundingOb",
    "SolidBox { enableBoundingObject 1 }": "expected TRUE or FALSE for enableBoun",
    'Rock { type "round" }': "expected type 'regular' or 'flat' for Rock, got 'ro",
    "Rock { scale 0 }": "14: expected a scale above 0 for Rock, got 0",
    "Group { children 1 }": "18: expected nodes for children of Group",
    "Solid { boundingObject IndexedFaceSet { coord Coordinate { point [ 1 2 ] } } }": (
        "expected x, y and z of each point"
    ),
    "Solid { boundingObject IndexedFaceSet { coordIndex [ 0 1 2 -1 ] } }": (
        "expected whole numbers below 0, or -1, in coordIndex"
    ),
}


@pytest.mark.parametrize("content", WRONG)
def test_a_wrong_value_says_where(content):
    """What is well formed but no such value is an error at its place."""
    with pytest.raises(WorldError, match=r"^w\.wbt, line 3, column \d+: ") as caught:
        read_world(text(content), "w.wbt")
    assert WRONG[content] in str(caught.value)


@pytest.mark.parametrize(
    "content",
    [
        "Solid { translation 1 2 1e9 }",
        "Transform { scale 1e6 1e6 1e6 children Pose { translation 9e5 0 0 } }",
    ],
)
def test_a_stray_node_can_be_ignored(content):
    """A node beyond all bounds is named with its place; the rest is read."""
    world = read_world(text(content, "WoodenBox { }"), "w.wbt")
    (stray,) = world.unmodelled
    assert stray.may_be_solid
    assert stray.why.startswith("w.wbt, line 3, column ")
    assert "beyond 1e+06" in stray.why
    assert [thing.kind for thing in world.obstacles] == ["WoodenBox"]


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("tiny", ["1e-9", "1e-300", "0.0001"])
def test_tiny_lengths_do_no_harm(tiny):
    """Nothing is too small to be drawn."""
    world = read_world(
        text(
            f"SolidPipe {{ radius {tiny} }}",
            f"SolidPipe {{ thickness {tiny} }}",
            f"SolidPipe {{ height {tiny} radius {tiny} rotation 1 0 0 1 }}",
            f"CircleArena {{ radius {tiny} wallThickness {tiny} wallHeight {tiny} }}",
            f"RectangleArena {{ floorSize {tiny} 1 }}",
            f"OilBarrel {{ radius {tiny} height {tiny} rotation 1 1 0 1 }}",
            f"Rock {{ scale {tiny} }}",
            f"Wall {{ size {tiny} {tiny} {tiny} rotation 1 2 3 4 }}",
            f"Transform {{ scale {tiny} {tiny} {tiny} children Solid {{ boundingObject",
            "  Group { children [ Box { } Sphere { } Capsule { } Cylinder { } ] } } }",
        )
    )
    assert len(world.arenas) == 2
    assert len(world.obstacles) == 7
    assert read_world(write_world(world)) == world


def test_the_coordinate_system_must_be_known():
    """The error lists those that are."""
    with pytest.raises(
        WorldError, match=r"column 30: expected .* of ENU, NUE, EUN, got"
    ):
        read_world(text(info='coordinateSystem "NED"'), "w.wbt")


@pytest.mark.slow
def test_nesting_and_size_are_bounded():
    """No file exhausts the stack or the memory, USE or not."""
    deep = "Group { children [ " * (DEEPEST - 1)
    read_world(text(deep + "] }" * (DEEPEST - 1)), "w.wbt")
    with pytest.raises(
        WorldError, match=r"column \d+: expected at most 100 nested nodes"
    ):
        read_world(text("Group { children [ " * (DEEPEST + 2)), "w.wbt")
    laughs = ["DEF A Group { children [ " + "Foo { } " * 10 + "] }"]
    laughs += ["DEF A Group { children [ " + "USE A " * 10 + "] }"] * 9
    with pytest.raises(WorldError, match=f"expected at most {MOST_NODES} nodes, got"):
        read_world(text(*laughs), "w.wbt")
    with pytest.raises(WorldError, match=f"more than {MOST_PARTS} convex pieces"):
        read_world(text(*["SolidPipe { subdivision 200 }"] * 51), "w.wbt")


def test_files_that_cannot_be_read(tmp_path):
    """Missing, a folder, or far too large: one line that says so."""
    with pytest.raises(WorldError, match=r"no\.wbt: no such file; check the path"):
        load_world(tmp_path / "no.wbt")
    with pytest.raises(WorldError, match=r"is a folder; give the \.wbt file in it"):
        load_world(tmp_path)
    large = tmp_path / "large.wbt"
    large.write_bytes(b"#VRML_SIM R2025a utf8\n" + b" " * LARGEST_FILE)
    with pytest.raises(WorldError, match=r"larger than 8 MB"):
        load_world(large)


def test_comments_in_another_encoding(tmp_path):
    """Old files hold Latin-1."""
    path = tmp_path / "old.wbt"
    path.write_bytes("#VRML_SIM V6.0 utf8\r# é\rE-puck { }".encode("latin-1"))
    assert len(load_world(path).robots) == 1


def broken_or_world(content: str, rng: random.Random) -> None:
    """Reads a mutated text: a World, or an error with line and column."""
    try:
        assert isinstance(read_world(mutated(content, rng), "w.wbt"), World)
    except WorldError as error:
        place = str(error).removeprefix("w.wbt, line ").split(": ")[0]
        line, column = place.split(", column ")
        assert int(line) >= 1
        assert int(column) >= 1


SOURCES = st.sampled_from([EVERYTHING, OLD])


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(source=SOURCES, rng=st.randoms(use_true_random=False))
def test_mutated_text_is_a_world_or_an_error_with_its_place(source, rng):
    """Whatever happened to a file, it is read, or refused at a line and column."""
    broken_or_world(source, rng)


@pytest.mark.slow
@settings(max_examples=10_000, deadline=None, suppress_health_check=list(HealthCheck))
@given(source=SOURCES, rng=st.randoms(use_true_random=False))
def test_ten_thousand_mutated_texts(source, rng):
    """As above, 10 000 times."""
    broken_or_world(source, rng)
