"""The shaders that a device keeps from frame to frame, and the choice among them for a frame."""

from __future__ import annotations

from dataclasses import replace

from halfstep.contract.arrays import U32, Bools
from halfstep.contract.classes import Class
from halfstep.contract.planes import OUTPUT_BYTES
from halfstep.device.handles import GpuDevice
from halfstep.host.tiles import LEAST_SHARE, Classes, frequent_sets, tile_groups
from halfstep.shader.needs import Needs
from halfstep.shader.source import TEXTURE, binding_types, compose


class Shaders:
    """The shaders for one `Needs`: one with all classes of solids, and some with fewer.

    All have the same bindings.
    """

    def __init__(self, needs: Needs, store: ShaderStore) -> None:
        """`ShaderStore.of` calls this."""
        self.needs = needs
        self.types = binding_types(needs)
        self.layout = store.layout(self.types)
        # The code for mirrors does not depend on the classes and compiles even longer, so shaders
        # with fewer classes would cost more than they save. Few frames continue others.
        self._may_have_parts = store.in_parts and needs.facts.isdisjoint({"mirrors", "continued"})
        self._whole = [needs.classes]
        self._sets: list[Classes] | None = None
        self._whole_is_quick = False
        self._store = store
        self._pipelines: dict[Classes, object] = {}
        # Shaders without mirrors, or else without highlights, for tiles that see none.
        self._plain: Shaders | None = None
        self._uses_plain: bool | None = None  # None until that is chosen
        if store.in_parts and "mirrors" in needs.facts:
            self._plain = store.of(replace(needs, bounces=0))
        elif self._may_have_parts and "gloss" in needs.facts:
            self._plain = store.of(replace(needs, shininess_bits=0))

    @property
    def compiles_later(self) -> bool:
        """Whether the next frame may compile shaders that no frame had before."""
        may_compile = self._may_have_parts or self._plain is not None
        return may_compile and not self._sets

    @property
    def may_use_plain(self) -> bool:
        """Whether `plain` may give shaders. The first frame uses one, as `sets` tells."""
        return None not in (self._plain, self._sets) and self._uses_plain is not False

    def plain(self, *, pays: bool) -> Shaders | None:
        """The shaders for tiles that see no mirror, or if these have no mirrors, no highlight.

        None if the same ones draw all tiles. They have some of the bindings. The second frame asks
        once whether it ``pays`` to use them, so that what moves later compiles nothing.
        """
        if self._plain is None or self._sets is None:
            return None
        if self._uses_plain is None:
            self._uses_plain = pays
        return self._plain.later() if self._uses_plain else None

    def later(self) -> Shaders:
        """These shaders, as after their first frame."""
        if self._sets is None:
            self._sets = []
        return self

    def sets(self, starts: U32, classes: Classes, left_out: Bools) -> list[Classes]:
        """The classes of each shader of a frame, those of the one that draws all tiles last.

        The lists begin at ``starts`` and are of ``classes``. Other shaders draw the tiles
        ``left_out``.

        The first frame uses one shader, because compiling takes longer than rendering. On a
        software adapter it is a quick one, and the second frame picks the sets of classes that get
        their own shader. So does the set of all classes, if then enough tiles are left for it.
        """
        if not self._may_have_parts:
            self._sets = self._whole
            return self._whole
        if self._sets is None:
            self._sets = []
            self._whole_is_quick = True
            return self._whole
        if not self._sets:
            often = frequent_sets(starts, classes, self.needs.classes, left_out)
            self._sets = [*often, *self._whole]
            groups = tile_groups(starts, classes, 1, self._sets, left_out)
            rest = sum(len(each.records) for each in groups if each.classes == self.needs.classes)
            self._whole_is_quick = rest * LEAST_SHARE < len(left_out)
        return self._sets

    def pipeline(self, classes: Classes) -> object:
        """The compiled shader for these classes."""
        if classes not in self._pipelines:
            # Shaders that do not know the program are those of other scenes, too.
            known = self.needs.known if Class.REGION_KNOWN in classes else None
            needs = replace(self.needs, classes=classes, known=known)
            if not classes and needs.outputs <= OUTPUT_BYTES.keys():
                needs = replace(needs, shadows=0, veils=False)  # nothing there is lit
            if classes == self.needs.classes and self._whole_is_quick and needs.quads > 1:
                needs = replace(needs, quick=True)
            pipeline = self._store.pipeline(needs, self.layout)
            if not self._sets:
                return pipeline
            self._pipelines[classes] = pipeline
        return self._pipelines[classes]


class ShaderStore:
    """All shaders of a device, compiled when a frame first needs them."""

    def __init__(self, device: GpuDevice, *, in_parts: bool) -> None:
        """``in_parts``: tiles that see few classes get their own shaders."""
        self.in_parts = in_parts
        self._device = device
        self._of: dict[Needs, Shaders] = {}
        self._layouts: dict[tuple[tuple[int, str], ...], object] = {}
        self._pipelines: dict[Needs, object] = {}

    def of(self, needs: Needs) -> Shaders:
        """The shaders of frames with these needs."""
        if needs not in self._of:
            self._of[needs] = Shaders(needs, self)
        return self._of[needs]

    def clear(self) -> None:
        """Forget all shaders. This breaks the reference cycle between them and the store."""
        self._of.clear()
        self._layouts.clear()
        self._pipelines.clear()

    def layout(self, types: dict[int, str]) -> object:
        """The bind group layout for these types by binding number."""
        key = tuple(types.items())
        if key not in self._layouts:
            entries = [
                {"binding": number, "visibility": "COMPUTE"} | _bound(number, type_)
                for number, type_ in key
            ]
            self._layouts[key] = self._device.create_bind_group_layout(entries=entries)
        return self._layouts[key]

    def pipeline(self, needs: Needs, layout: object) -> object:
        """The compiled shader of ``needs``."""
        if needs not in self._pipelines:
            module = self._device.create_shader_module(label="halfstep", code=compose(needs))
            self._pipelines[needs] = self._device.create_compute_pipeline(
                label="render",
                layout=self._device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": module, "entry_point": "render"},
            )
        return self._pipelines[needs]


def _bound(number: int, type_: str) -> dict[str, object]:
    """The part of an entry of a layout that depends on the type of the binding."""
    if type_ == TEXTURE:
        return {"texture": {"sample_type": "uint", "view_dimension": "2d"}}
    return {"buffer": {"type": type_, "has_dynamic_offset": number == 3}}
