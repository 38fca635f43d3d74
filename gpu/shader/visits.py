"""The part of a kernel that tries a solid of each class on a block of pixels."""

from __future__ import annotations

from halfstep.contract.classes import Class
from halfstep.contract.layout import HALF_SPACE
from halfstep.shader.needs import Needs
from halfstep.shader.statements import each_quad, fetch, loop, quads, variables, vector

CURVED = frozenset({Class.ELLIPSOID, Class.QUADRIC, Class.QUADRIC_INSIDE})
INSIDE = frozenset({Class.QUADRIC_INSIDE, Class.POLYHEDRON_INSIDE})


def _members(needs: Needs) -> list[tuple[str, str, str]]:
    """Of each member of Nearest its declaration, its value at first and that of a new point."""
    far = "Key(u4(0xFFFFFFFFu), u4(0xFFFFFFFFu))"

    def nearer_key(name: str) -> str:
        words = (f"select(old.{name}.{word}, {name}.{word}, nearer)" for word in ("high", "low"))
        return f"Key({', '.join(words)})"

    members = [
        ("key: u4", "u4(0xFFFFFFFFu)", "select(old.key, key, nearer)")
        if needs.short_keys
        else ("key: Key", far, nearer_key("key")),
        ("surface: u4", "u4(0u)", "select(old.surface, surface, nearer)"),
    ]
    zero = "Vector(f4(0.0), f4(0.0), f4(0.0))"
    if needs.leaving:
        members.append(("leaves: Key", far, nearer_key("leaves")))
    if needs.certified:
        members.append(("low: Key", far, _lower_key("low", "confirmed & hit")))
        members.append(("doubt: Key", far, _lower_key("doubt", "!confirmed")))
        value = "select(old.bound, certificate.bound, nearer)"
        members.append(("bound: f4", "f4(0.0)", value))
    if needs.oriented:
        value = vector("select(old.slope.AXIS, slope.AXIS, nearer)")
        members.append(("slope: Vector", zero, value))
    if needs.shaded:
        value = ", ".join(
            f"select(old.color.{axis}, f4(solid.color[{k}]), nearer)"
            for k, axis in enumerate("xyz")
        )
        members.append(("color: Vector", zero, f"Vector({value})"))
    if needs.shaded and needs.shininess_bits:
        value = "select(old.specular, f4(solid.specular), nearer)"
        members.append(("specular: f4", "f4(0.0)", value))
        value = "select(old.shininess, u4(solid.shininess), nearer)"
        members.append(("shininess: u4", "u4(0u)", value))
    if needs.shaded and needs.point_lights:
        depth = "solid.depth_middle + (f4(position) * solid.last_step) * solid.depth_half"
        members.append(("depth: f4", "f4(0.0)", f"select(old.depth, {depth}, nearer)"))
    return members


def _lower_key(name: str, where: str) -> str:
    """The lesser of an old key and a new one, the latter only in some pixels."""
    lower = f"{where} & before({name}, u4(0u), old.{name}, u4(0u))"
    words = (f"select(old.{name}.{word}, {name}.{word}, {lower})" for word in ("high", "low"))
    return f"Key({', '.join(words)})"


def declare_nearest(needs: Needs) -> str:
    """The struct of the nearest point so far, and the function that gives it at first."""
    members = _members(needs)
    body = "".join(f"  {declaration},\n" for declaration, _, _ in members)
    return (
        f"// The nearest visible point so far.\nstruct Nearest {{\n{body}}}\n\n"
        f"fn nothing() -> Nearest {{\n  return Nearest({', '.join(m[1] for m in members)});\n}}\n"
    )


def declare_keep(needs: Needs) -> str:
    """The function that replaces the nearest point where a nearer one was found."""
    parameters = ["old: Nearest", "solid: Solid", "hit: b4", "number: i4", "position: i4"]
    interval = "solid.steps, solid.key_high, solid.key_low, solid.key_shift"
    key, before = f"depth_key(position, {interval})", "before"
    if needs.short_keys:
        key, before = (
            "short_key(position, solid.steps, solid.key_low, solid.key_shift)",
            "short_before",
        )
    extra = ""
    if needs.leaving:
        parameters += ["left: b4", "exit_position: i4"]
        extra = (
            f"  let exit_key = depth_key(exit_position, {interval});\n"
            "  let leaves = Key(select(u4(0xFFFFFFFFu), exit_key.high, left),"
            " select(u4(0xFFFFFFFFu), exit_key.low, left));\n"
        )
    if needs.oriented:
        parameters.append("slope: Vector")
    if needs.certified:
        parameters.append("certificate: Certificate")
        extra += (
            "  let confirmed = confirms(certificate, hit, number);\n"
            "  let low = least_key(key, certificate.bound, solid.steps, solid.spare,"
            " solid.key_shift);\n"
            "  let doubt = Key(u4(solid.key_high), u4(solid.key_low));\n"
        )
    values = ",\n    ".join(member[2] for member in _members(needs))
    return (
        "// Keeps a point if it is nearer than the nearest so far.\n"
        f"fn keep({', '.join(parameters)}) -> Nearest {{\n"
        f"  let key = {key};\n"
        "  let surface = u4(solid.surface) + u4(number);\n"
        f"  let nearer = hit & {before}(key, surface, old.key, old.surface);\n"
        f"{extra}  return Nearest(\n    {values},\n  );\n"
        "}\n"
    )


def declare_lines(needs: Needs) -> str:
    """What stands for ``lines.wgsl`` in a kernel: half-spaces are fetched when they are tried."""
    lane, before = "", ""
    if needs.together > 1:
        lane, before = "  lane: u32,\n", "    let lane = (*lines).lane;\n"
    fetched = fetch(needs, HALF_SPACE, "half_spaces", "(*lines).start + j", "half_space")
    return (
        "// Where the half-spaces of a solid are, and the quad on whose rays they are tried.\n"
        f"struct Lines {{\n  at: Offset,\n  start: u32,\n{lane}}}\n\n"
        "// A half-space along the rays, counted from 0.\n"
        "fn line_of(lines: ptr<function, Lines>, j: u32) -> Line {\n"
        f"{before}    let at = (*lines).at;\n{fetched}    return {_LINE};\n}}\n"
    )


_EYE_OUTSIDE = "b4((solid.flags & FLAG_EYE_OUTSIDE_QUADRIC) != 0u)"
_STARTS_AT_EYE = "b4((solid.flags & FLAG_STARTS_AT_EYE) != 0u)"
_EYE_INSIDE = "((solid.flags & FLAG_EYE_INSIDE) != 0u)"
_NEAR_CUT = "b4((solid.flags & FLAG_NEAR_CUT) != 0u)"
_LINE = "line_at(half_space.c, half_space.b, at)"
_LINE_ERRORS = "line_errors(half_space.c, half_space.b, at, half_space.host_error)"
_FORM = "    let form = form_at(solid.a, solid.g, solid.c, at);\n"
# At the eye the sign of F is known from the host; elsewhere it is that of F at the entry.
_OUTSIDE = f"""\
    let from_eye = (piece.id_in == i4(0)) & {_STARTS_AT_EYE};
    let outside = select(outside_at_entry(form, piece), {_EYE_OUTSIDE}, from_eye);
"""


def try_solid(needs: Needs, klass: Class) -> str:
    """Statements that try one solid of a class on the block."""
    if needs.certified:
        return _certify(needs, klass) + _sight(needs, klass)
    return _sight(needs, klass)


def _sight(needs: Needs, klass: Class) -> str:
    """Statements that find the visible point of one solid and keep it."""
    if needs.method == "article":
        return _article(needs, klass)
    if klass is Class.PATCH:
        return _visible_patch(needs)
    if klass is Class.ELLIPSOID:
        return _seen(needs, _FORM, "ellipsoid_entry(form)", "ellipsoid_exit(form)", _GRADIENT)
    return _visible_cut(needs, klass)


def _half_spaces(needs: Needs, first: int, body: str) -> str:
    """A loop over the solid's half-spaces, each tried on all quads."""
    fetched = fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start + k", "half_space")
    return loop("k", f"{first}u", "solid.plane_count", fetched + quads(needs, body))


def per_root(needs: Needs, roots: tuple[str, ...], template: str) -> str:
    """``template`` for every quad of the block and every root, with ROOT in it for its name."""
    return each_quad(needs, "".join(template.replace("ROOT", root) for root in roots))


def conveyor(needs: Needs, roots: tuple[str, ...]) -> str:
    """Statements that halve ``roots`` of all quads, n times each, to the position of each."""
    begin = "    var search_ROOT_NTH = begun(ROOT_NTH);\n"
    halving = "      search_ROOT_NTH = halved(search_ROOT_NTH, k);\n"
    end = "    let ROOT_position_NTH = reached(search_ROOT_NTH, ROOT_NTH, solid.steps);\n"
    return (
        per_root(needs, roots, begin)
        + loop("k", "0u", "solid.steps", per_root(needs, roots, halving))
        + per_root(needs, roots, end)
    )


_PLANE_NORMAL = (
    "Vector(f4(half_space.normal[0]), f4(half_space.normal[1]), f4(half_space.normal[2]))"
)
_GRADIENT = "gradient(solid.gradient, f4(x_NTH), f32(y), f4(position) * solid.last_step)"


def _seen(needs: Needs, body: str, root: str, leaving: str, slope: str, normals: str = "") -> str:
    """Statements that halve the seen root and keep the point.

    The expressions ``root`` and ``leaving`` may use what the statements ``body`` define for a quad,
    ``slope``, the normal of what is met there, what ``normals`` do.
    """
    roots = {"root": root} | ({"leaving": leaving} if needs.leaving else {})
    text = "".join(variables(needs, name, "Root") for name in roots)
    found = "".join(f"    {name}_NTH = {value};\n" for name, value in roots.items())
    text += quads(needs, body + found) + conveyor(needs, tuple(roots))
    arguments = ["nearest_NTH", "solid", "root_NTH.hit", "root_NTH.surface", "position"]
    if needs.leaving:
        arguments += ["leaving_NTH.hit", "leaving_position_NTH"]
    arguments += [slope] * needs.oriented + ["certificate_NTH"] * needs.certified
    kept = f"    nearest_NTH = keep({', '.join(arguments)});\n"
    kept = "    let position = root_position_NTH;\n" + normals * needs.oriented + kept
    return text + quads(needs, kept, offsets=False)


def _visible_patch(needs: Needs) -> str:
    turned = vector("select(own_normal.AXIS, -own_normal.AXIS, patch_NTH.away)")
    own = fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own")
    if needs.oriented:
        own += f"    let own_normal = {_PLANE_NORMAL.replace('half_space', 'own')};\n"
    facing = "    patch_NTH = facing(line_at(own.c, own.b, at), solid.near_u, solid.far_u);\n"
    return (
        own
        + variables(needs, "patch", "Patch")
        + quads(needs, facing)
        + _half_spaces(needs, 1, f"      patch_NTH = bound(patch_NTH, {_LINE});\n")
        + _seen(needs, "", "patch_entry(patch_NTH)", "root_NTH", turned)
    )


def _visible_cut(needs: Needs, klass: Class) -> str:
    """A solid with half-spaces or base planes across it: clip, joint logic, halve."""
    curved, opened = klass in CURVED, klass in INSIDE
    text = variables(needs, "piece", "Piece")
    # Normals of the planes where the pieces begin and end; the latter show from inside.
    ends = ["in", *["out"] * opened] if needs.oriented else []
    text += "".join(variables(needs, f"normal_{end}", "Vector") for end in ends)
    text += quads(needs, "    piece_NTH = whole_interval(solid.near_u, solid.far_u);\n")
    clip = f"      let piece = clip(piece_NTH, {_LINE}, i32(k) + 1);\n      piece_NTH = piece;\n"
    for end in ends:
        turned = vector(
            f"select(normal_{end}_NTH.AXIS, normal.AXIS, piece.id_{end} == i4(i32(k) + 1))"
        )
        clip += f"      normal_{end}_NTH = {turned};\n"
    if ends:
        clip = f"      let normal = {_PLANE_NORMAL};\n" + clip
    text += _half_spaces(needs, 0, clip)

    row = "    let piece = piece_NTH;\n"
    if opened:
        row = "    let clipped = piece_NTH;\n    var piece = clipped;\n"
        row += (
            f"    if {_EYE_INSIDE} {{\n      piece = from_the_eye(clipped, solid.near_u);\n    }}\n"
        )
    if curved:
        row += _FORM + _OUTSIDE
    entry, leaving = "polyhedron_entry(piece)", "polyhedron_exit(piece)"
    if curved:
        entry = "quadric_entry(form, piece, outside)"
        leaving = "quadric_exit(form, piece, !outside)"
    if opened:
        at_near = f"{_NEAR_CUT} & (piece.id_in == i4(0))" + " & !outside" * curved
        row += f"    let inside = b4({_EYE_INSIDE}) | ({at_near});\n"
        entry = f"choose(inside, {entry}, {leaving})"
    if opened and needs.oriented:
        shown = vector("select(normal_in_NTH.AXIS, normal_out_NTH.AXIS, inside)")
        row += f"    normal_in_NTH = {shown};\n"
    if not curved:
        return text + _seen(needs, row, entry, leaving, "normal_in_NTH")
    mixed = vector("select(normal_in_NTH.AXIS, curved.AXIS, root_NTH.surface == i4(0))")
    normals = f"    let curved = {_GRADIENT};\n    let slope = {mixed};\n"
    return text + _seen(needs, row, entry, leaving, "slope", normals)


def _certify(needs: Needs, klass: Class) -> str:
    """Statements that give every quad what is certain of it."""
    text = variables(needs, "certificate", "Certificate")
    near_cut, last_step = "(solid.flags & FLAG_NEAR_CUT) != 0u", "solid.last_step"
    run = needs.format.article_run if needs.method == "article" else needs.format.run
    form = (
        "    let form = bounded_form(form_at(solid.a, solid.g, solid.c, at),"
        " form_errors(solid.a, solid.g, solid.c, at, solid.host_error));\n"
    )
    if klass is Class.PATCH:
        own = f"{_LINE}, {_LINE_ERRORS}".replace("half_space", "own_line")
        facing = (
            f"      bounded_NTH = bounded_facing({own}, solid.near_u, solid.far_u, {near_cut});\n"
        )
        text += fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own_line")
        text += variables(needs, "bounded", "BoundedPatch")
        text += quads(needs, facing)
        text += _half_spaces(
            needs,
            1,
            f"      bounded_NTH = bounded_bound(bounded_NTH, {_LINE}, {_LINE_ERRORS});\n",
        )
        return text + quads(
            needs,
            f"    certificate_NTH = certify_patch(bounded_NTH, {last_step});\n",
            offsets=False,
        )
    if klass is Class.ELLIPSOID:
        return text + quads(
            needs, form + f"    certificate_NTH = certify_ellipsoid(form, {run}, {last_step});\n"
        )
    text += variables(needs, "bounded", "BoundedPiece")
    text += quads(
        needs,
        f"    bounded_NTH = bounded_interval(solid.near_u, solid.far_u, {near_cut});\n",
        offsets=False,
    )
    text += _half_spaces(
        needs,
        0,
        f"      bounded_NTH = bounded_clip(bounded_NTH, {_LINE}, {_LINE_ERRORS}, i32(k) + 1);\n",
    )
    eye_sure = "(solid.flags & FLAG_EYE_SURE) != 0u"
    row = (
        f"    if {_EYE_INSIDE} {{\n"
        "      bounded_NTH = bounded_from_the_eye(bounded_NTH, solid.near_u);\n"
        "    }\n"
        "    let at_start = bounded_NTH.piece.id_in == i4(0);\n"
    )
    if klass in CURVED:
        row += form + (
            f"    certificate_NTH = certify_quadric(form, bounded_NTH, at_start & {_STARTS_AT_EYE}"
            f", (solid.flags & FLAG_EYE_OUTSIDE_QUADRIC) != 0u, {eye_sure},"
            f" (solid.flags & (FLAG_EYE_INSIDE | FLAG_NEAR_CUT)) != 0u, {run}, {last_step});\n"
        )
    else:
        row += (
            f"    let opened = b4({_EYE_INSIDE}) | ({_NEAR_CUT} & at_start);\n"
            f"    certificate_NTH = certify_polyhedron(bounded_NTH, opened, {eye_sure},"
            f" {last_step});\n"
        )
    return text + quads(needs, row)


def _article(needs: Needs, klass: Class) -> str:
    """The paper's own sequences, a quad at a time."""
    lane = ", lane" * (needs.together > 1)
    row = f"    var lines = Lines(at, solid.plane_start{lane});\n"
    base_planes = "&lines, solid.plane_count, solid.near_u, solid.far_u"
    if klass is Class.PATCH:
        row += f"    let found = article_patch({base_planes}, solid.steps);\n"
    elif klass in CURVED:
        row += _FORM
        row += (
            "    let first = (form.a - form.g) + form.c;\n"
            f"    let outside = select(first > v4(0), {_EYE_OUTSIDE}, {_STARTS_AT_EYE});\n"
            f"    let found = article_quadric(form, outside, {base_planes}, {_EYE_INSIDE},"
            " solid.steps, solid.last_step);\n"
        )
    else:
        row += (
            f"    let found = article_polyhedron({base_planes}, {_EYE_INSIDE}, solid.steps,"
            " solid.last_step);\n"
        )
    row += "    let position = found.position;\n"
    # In one cell the way in and the way out through a surface may stand for each other.
    if needs.certified:
        row += (
            "    let same = certificate_NTH.inside == found.inside;\n"
            "    certificate_NTH.sure = certificate_NTH.sure & same;\n"
        )
    arguments = ["nearest_NTH", "solid", "found.hit", "found.surface", "position"]
    if needs.leaving:
        arguments += ["found.left", "found.exit_position"]
    if needs.oriented:
        row += _article_slope(needs, klass)
        arguments.append("slope")
    arguments += ["certificate_NTH"] * needs.certified
    return quads(needs, row + f"    nearest_NTH = keep({', '.join(arguments)});\n")


def _article_slope(needs: Needs, klass: Class) -> str:
    """The normal of the surface found: the article method knows it only at the end."""
    if klass is Class.PATCH:
        own = fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own")
        normal = _PLANE_NORMAL.replace("half_space", "own")
        first = "line_of(&lines, 0u).b"
        turned = vector(f"select(normal.AXIS, -normal.AXIS, {first} > v4(0))")
        return f"{own}    let normal = {normal};\n    let slope = {turned};\n"
    first = _GRADIENT if klass in CURVED else "Vector(f4(0.0), f4(0.0), f4(0.0))"
    turned = vector("select(slope.AXIS, normal.AXIS, found.surface == i4(i32(k) + 1))")
    half_space = fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start + k", "half_space")
    return (
        f"    var slope = {first};\n"
        "    for (var k = 0u; k < solid.plane_count; k++) {\n"
        f"{half_space}"
        f"      let normal = {_PLANE_NORMAL};\n"
        f"      slope = {turned};\n"
        "    }\n"
    )
