"""Mutated models: each is drawn as an independent oracle says, or refused in clear words.

    python -m tests.model_mutations --count 100 --seed 1

Every file of `tests/models`, and a surface of SURFER, gets one to three faults or oddities: missing
and repeated keys, odd numbers, other ids, huge lattices, comments, namespaces, other encodings and
line ends. Halfstep may refuse such a file with exit code 2 and messages that name the file. If it
draws the file, the oracles of `tests/model_frames.py` and `tests/openscad_silhouettes.py` judge it.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from halfstep.errors import HalfstepError, SceneError, UsageError
from halfstep.models import check, load
from halfstep.scene import Scene
from tests import model_frames, openscad_silhouettes

MODELS = Path(__file__).with_name("models")
SIZE = (28, 21)
GOOD = {"refused", "drawn", "not judged", "overlaps"}
# No file here is large, so none may take longer to read or refuse, in seconds of the processor.
MOST_SECONDS = 10.0
ODD = (
    "nan", "inf", "-inf", "1e400", "-1e16", "1e15", "1e-320", "1e-12", "0", "-0", "-1", "+3", "007",
    "1.", ".5", "1e", "0x10", "1_000", "\uff11\uff12", "\u221e", "", " ", "1,5", "2147483648",
    "99999999999999999999", "3 3", "\u0663", "1e-9", "1000000", "-", "|", "~", "void", "\u00e9",
)  # fmt: skip
SURFACE = r"""#surfer
surface_title=a heart
surface_equation=(x^2+9/4*y^2+z^2-1)^3-x^2*z^3-a*y^2*z^3
surface_parameter_a=0.1
scale_factor=0.2
front_material_color=0.7 0.1 0.1
light_status_0=ON
light_position_0=-2.0 2.0 3.0
light_color_0=1.0 1.0 1.0
rotation_matrix=1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
"""

Mutation = Callable[[str, random.Random], str | bytes]


def _changed(pattern: str, new: Callable[[re.Match[str], random.Random], str]) -> Mutation:
    """Replace one match of a pattern."""

    def mutate(text: str, rng: random.Random) -> str:
        found = [*re.finditer(pattern, text)]
        if not found:
            return text
        match = rng.choice(found)
        return text[: match.start()] + new(match, rng) + text[match.end() :]

    return mutate


def _prefixed(text: str, _rng: random.Random) -> str:
    return re.sub(r"<(/?)([a-z])", r"<\1m:\2", text)


def _without_tail(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text))]


def _attributes_to_children(text: str, _rng: random.Random) -> str:
    def children(match: re.Match[str]) -> str:
        keys = re.findall(r'([\w:]+)\s*=\s*"([^"]*)"', match[2])
        inside = "".join(f"<{key}>\n {value}\t</{key}>" for key, value in keys)
        return f"<{match[1]}>{inside}</{match[1]}>"

    return re.sub(r"<(surface|cell)\b([^>]*)/>", children, text)


NUMBER = r"(?<![\w.$])-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?![\w.])"
ANY: dict[str, Mutation] = {
    "an odd number": _changed(NUMBER, lambda _, rng: rng.choice(ODD)),
    "another number": _changed(NUMBER, lambda _, rng: f"{rng.uniform(-9, 9):.3g}"),
    "another id": _changed(NUMBER, lambda _, rng: str(rng.randrange(1, 60))),
    "a character less": _changed(r"\S", lambda *_: ""),
    "a character more": _changed(r"\S", lambda m, rng: m[0] + rng.choice("()<>&\"'~|;{}[]=,\0\\é")),
    "truncated": _without_tail,
    "line ends": lambda text, _: text.replace("\n", "\r\n"),
    "old line ends": lambda text, _: text.replace("\n", "\r").encode(),
    "a mark of order": lambda text, _: b"\xef\xbb\xbf" + text.encode(),
    "16 bits": lambda text, _: text.encode("utf-16"),
    "no text": lambda text, rng: text.encode() + bytes(rng.randrange(256) for _ in range(20)),
    "a line twice": _changed(r"[^\n]+\n", lambda m, _: 2 * m[0]),
    "a line less": _changed(r"[^\n]+\n", lambda *_: ""),
}
XML: dict[str, Mutation] = {
    "a key less": _changed(r'\s[\w:]+="[^"]*"', lambda *_: ""),
    "a key twice": _changed(r'\s[\w:]+="[^"]*"', lambda m, _: 2 * m[0]),
    "an empty key": _changed(r'="[^"]*"', lambda *_: '=""'),
    "a key in capitals": _changed(r"\s\w+=", lambda m, _: m[0].upper()),
    "an odd value": _changed(r'="[^"]*"', lambda _, rng: f'="{rng.choice(ODD)}"'),
    "an element less": _changed(r"<\w+[^<>]*/>", lambda *_: ""),
    "an element twice": _changed(r"<\w+[^<>]*/>", lambda m, _: 2 * m[0]),
    "a comment": _changed(r">", lambda *_: "><!-- é <cell id='1'/> -->"),
    "a comment in a text": _changed(r"(?<=>)[^<>]*\d ", lambda m, _: m[0] + "<!-- 7 -->"),
    "raw text": _changed(r"(?<=>)[^<>]*\d[^<>]*(?=</)", lambda m, _: f"<![CDATA[{m[0]}]]>"),
    "an instruction": _changed(r"\n", lambda *_: "\n<?a b?>\n"),
    "a namespace": _changed(r"<(geometry|model)\b", lambda m, _: f'{m[0]} xmlns="urn:x"'),
    "a prefix": _changed(r"<(geometry|model)\b", lambda m, _: f'{m[0]} xmlns:m="urn:x" m:id="8"'),
    "prefixes": _prefixed,
    "children": _attributes_to_children,
    "escapes": _changed(r"\d(?=[^<>]*>)", lambda m, _: f"&#{ord(m[0])};"),
    "an entity": _changed(r'="[^"]*"', lambda *_: '="&a;"'),
    "a huge lattice": _changed(
        r"(?s)(dimension|n_rings|n_axial)(=\"|>\s*)\d+", lambda m, _: f"{m[1]}{m[2]}99999999"
    ),
    "a name": _changed(r"<cell ", lambda *_: '<cell name="&#x1F600; &lt;b&gt; \u202e" '),
    "a turn": _changed(r'\sfill="', lambda m, rng: f' rotation="{rng.choice(ODD)} 0 9"{m[0]}'),
    "a complement": _changed(r'region="([^"]*)"', lambda m, _: f'region="~({m[1]}) | ({m[1]})"'),
}
CSG: dict[str, Mutation] = {
    "a call less": _changed(r"\w+\([^()]*\);", lambda *_: ";"),
    "another call": _changed(
        r"\b(cube|sphere|cylinder|union|difference|intersection|group)\b",
        lambda _, rng: rng.choice(
            ["cube", "sphere", "cylinder", "hull", "difference", "union", "intersection", "echo"]
        ),
    ),
    "a mark": _changed(r"\b\w+\(", lambda m, rng: rng.choice("%#!*") + m[0]),
    "a comment": _changed(r"[,;]", lambda m, _: m[0] + "/* ) } */ // é\n"),
    "a key less": _changed(r"\$?\w+ = [^,()\[\]]+, ", lambda *_: ""),
    "a string": _changed(NUMBER, lambda *_: '"a\\"b"'),
    "nested": lambda text, _: 150 * "group() {" + text + 150 * "}",
}
JSURF: dict[str, Mutation] = {
    "a formula": _changed(
        r"(?<=equation=).*", lambda _, rng: rng.choice(["x", "", "x^11", "1/0", "y+(", "é", "x^y"])
    ),
    "escaped": _changed(r"[a-z]", lambda m, _: f"\\u{ord(m[0]):04x}"),
    "a long line": _changed(r"[ =+]", lambda m, _: m[0] + "\\\n   "),
}
KINDS = {".xml": XML, ".csg": CSG, ".jsurf": JSURF}


class Case(NamedTuple):
    """A mutated model.

    Attributes:
        name: name of the model.
        how: names of the mutations.
        content: bytes of the file.
    """

    name: str
    how: tuple[str, ...]
    content: bytes


def case(seed: int, number: int, endings: tuple[str, ...] = tuple(KINDS)) -> Case:
    """The mutated model with a number, always the same."""
    rng = random.Random(f"{seed} {number}")
    ending = endings[number % len(endings)]
    files = sorted(MODELS.glob(f"*{ending}"))
    path = rng.choice(files) if files else Path(f"surface{ending}")
    text = path.read_text(encoding="utf-8") if files else SURFACE
    mutations = ANY | KINDS[ending]
    how = tuple(rng.choice([*mutations]) for _ in range(rng.choice([1, 1, 1, 2, 3])))
    content: str | bytes = text
    for name in how:
        if isinstance(content, str):
            content = mutations[name](content, rng)
    return Case(path.name, how, content.encode() if isinstance(content, str) else content)


def verdict(given: Case, folder: Path) -> str:
    """What becomes of a mutated model: one of `GOOD`, or what is wrong."""
    path = folder / given.name
    path.write_bytes(given.content)
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = load(path)
    except (SceneError, UsageError) as error:
        faults = error.faults if isinstance(error, SceneError) else [str(error)]
        unclear = [each for each in faults if not each.startswith(path.name)]
        if unclear:
            return f"unclear: {unclear[0]}"
        return _within(begin) or "refused"
    except Exception as error:
        return f"broken: {type(error).__name__}: {error}"
    if late := _within(begin):
        return late
    try:
        return _drawn(path, scene)
    except HalfstepError as error:
        return "refused" if path.stem in str(error) else f"unclear: {error}"


def _within(begin: float) -> str:
    spent = time.process_time() - begin
    return f"slow: {spent:.1f} s" if spent > MOST_SECONDS else ""


def _drawn(path: Path, scene: Scene) -> str:
    if path.suffix == ".jsurf":
        return "drawn"
    try:
        if path.suffix == ".csg":
            wrong = openscad_silhouettes.judged(path, backend="numpy", size=SIZE)[2]
            return f"wrong: {wrong} rays" if wrong else "drawn"
        found = model_frames.judged(path, scene, SIZE)
    except HalfstepError:
        raise
    except Exception:
        return "not judged"
    if not found["wrong"] and not found["skipped"]:
        return "drawn"
    # Of cells that overlap the first has a point, unless it is not shown.
    return "overlaps" if check(path, rays=24).overlaps else f"wrong: {found}"


def main() -> int:
    """Mutate models; 1 if one is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ending", choices=[*KINDS], action="append")
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.count):
            given = case(arguments.seed, number, tuple(arguments.ending or KINDS))
            found = verdict(given, Path(folder))
            counts[found.partition(":")[0]] += 1
            if found not in GOOD:
                sys.stdout.write(f"{number} {given.name} {', '.join(given.how)}: {found}\n")
                sys.stdout.flush()
    sys.stdout.write(f"{dict(counts)}\n")
    return int(not counts.keys() <= GOOD)


if __name__ == "__main__":
    sys.exit(main())
