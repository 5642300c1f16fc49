"""A random scene: a function of a seed and a number."""

import json
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.experiments.fuzz import assets, parts
from comparisons.experiments.fuzz.data import Data, text_of
from comparisons.experiments.fuzz.fields import Draw, Names, rounded, values
from comparisons.experiments.fuzz.finding import Grammar
from comparisons.experiments.fuzz.parts import REACH, RefusedError
from comparisons.experiments.fuzz.schema import GROUPS, NO_SURFACE, kind_of, of_media, types
from reference_rt.integrators import RayCast
from reference_rt.rendering.render import render
from reference_rt.rendering.scene import Scene
from reference_rt.shapes import Plane
from reference_rt.shapes.instances import Instance
from reference_rt.shapes.shape import Solid
from reference_rt.util.errors import SceneWarning

# ---- parts put together -------------------------------------------------------------------------


INTEGRATORS = {"path": 6.0, "direct": 2.0, "whitted": 1.5, "ray_cast": 0.7}
"""How often an integrator is drawn; one that is not named here: 1."""

WITH_MEDIA = 0.12
"""The share of scenes of path tracing that have media: Mitsuba's follows them slowly."""

WITH_SOLIDS = 0.25
"""The share of scenes that may have solids: with them Mitsuba compares hits, not light."""


class Assembly:
    """The scene while it is made.  draw: random numbers;  wanted: types that it must have."""

    def __init__(self, draw: Draw, wanted: dict[str, list[str]], folder: Path) -> None:
        self.draw, self.wanted, self.folder = draw, wanted, folder
        self.names = Names(files=assets.FILES)
        self.textures: Data = {}
        self.materials: Data = {}
        self.groups: Data = {}

    def data(self) -> Data:
        draw = self.draw
        self._add_textures()
        self._add_materials()
        found: Data = {}
        film = {"width": int(draw.rng.integers(12, 25)), "height": int(draw.rng.integers(9, 19))}
        kind = self._one_of("camera")
        found["camera"] = parts.camera(draw, kind, film["width"], film["height"])
        integrator = self._integrator()
        found["film"] = film | self._film(str(integrator["type"]))
        found |= self._sampler(integrator)
        found["integrator"] = integrator
        shapes = self._shapes()
        lights = self._lights(integrator, shapes)
        if draw.chance(0.3):
            found["hierarchy"] = draw.pick(("auto", "sah", "median", "spatial", "none"))
        found |= {"textures": self.textures, "materials": self.materials, "groups": self.groups}
        found |= {"shapes": shapes, "lights": lights}
        found = {key: value for key, value in found.items() if value}
        return self._with_media(found) if self._has_media(found) else found

    # ---- one of a kind --------------------------------------------------------------------------

    def _one_of(self, kind: str, weights: dict[str, float] | None = None) -> str:
        if self.wanted.get(kind):
            return str(self.draw.pick(self.wanted[kind]))
        known = [*types(kind)]
        share = np.array([(weights or {}).get(name, 1.0) for name in known])
        return str(known[int(self.draw.rng.choice(len(known), p=share / share.sum()))])

    def _integrator(self) -> Data:
        kind = "path" if self._wants_media() else self._one_of("integrator", INTEGRATORS)
        found = values(types("integrator")[kind], self.draw, self.names)
        if "sampling" in found and self.draw.chance(0.8):
            found["sampling"] = "both"
        if self.draw.chance(0.8):  # else Mitsuba's own integrator is hardly compared
            found.pop("hide_emitters", None)
        found.pop("shadows", None)  # Mitsuba has no integrator without
        return found

    def _film(self, integrator: str) -> Data:
        draw = self.draw
        found: Data = {}
        if self.wanted.get("filter") or draw.chance(0.15):
            found["filter"] = values(types("filter")[self._one_of("filter")], draw, self.names)
        if draw.chance(0.06):
            layers = ["albedo", "normal", "depth", "id"]
            draw.rng.shuffle(layers)
            found["layers"] = layers[: int(draw.rng.integers(1, 5))]
        return found

    def _sampler(self, integrator: Data) -> Data:
        kind = self._one_of("sampler")
        is_random = not getattr(types("integrator")[integrator["type"]], "deterministic", True)
        if is_random and kind == "grid":
            kind = "sobol"
        if not is_random and self.draw.chance(0.7) and not self.wanted.get("sampler"):
            kind = "grid"
        return {"sampler": values(types("sampler")[kind], self.draw, self.names)}

    # ---- textures and materials -----------------------------------------------------------------

    def _add_textures(self) -> None:
        draw = self.draw
        pool = [*self.wanted.get("texture", ())]
        if draw.chance(0.5):
            pool += self._some("texture", 0, 3)
        pool.sort(key=lambda kind: kind == "product")
        if pool[:1] == ["product"]:
            pool.insert(0, "checker")
        for k, kind in enumerate(pool):
            self._add_texture(f"t{k}", kind)

    def _add_texture(self, name: str, kind: str) -> None:
        cls = types("texture")[kind]
        self.textures[name] = values(cls, self.draw, self.names)
        self.names.textures.append(name)
        if kind != "product":
            self.names.factors.append(name)
        if "file" in cls.model_fields:
            self.names.images.append(name)

    def _some(self, kind: str, low: int, high: int) -> list[str]:
        """A random subset of a kind's types: a scene with few types shows what they do together,
        and of all types at once each would hide the others."""
        known = [name for name in types(kind) if (kind, name) != NO_SURFACE]
        count = min(int(self.draw.rng.integers(low, high + 1)), len(known))
        return [known[i] for i in self.draw.rng.permutation(len(known))[:count]]

    def _add_materials(self) -> None:
        wanted = [name for name in self.wanted.get("material", ()) if name != NO_SURFACE[1]]
        wanted += self._some("material", 1, 5)
        known = types("material")
        # What is made of others comes last; of two such the order is random.
        wanted.sort(key=lambda kind: bool(_bases(known[kind])))
        if wanted and _bases(known[wanted[0]]):
            wanted.insert(0, "diffuse")
        images = any(_names_image(known[kind]) for kind in wanted)
        if "normal_map" in wanted:
            image = {"type": "bitmap", "file": assets.NORMALS, "encoding": "raw"}
            self.textures["normals"] = image
            self.names.normals.append("normals")
        if images and not self.names.images:
            self._add_texture(f"t{len(self.textures)}", "bitmap")
        for kind in wanted:
            try:
                found = parts.material(
                    self.draw, kind, self.materials, self.names, self.textures, self.folder
                )
            except RefusedError:
                continue
            self.materials[f"m{len(self.materials)}"] = found

    def _material(self, lamp: bool = False) -> str | None:
        """The name of a material; None for the default one."""
        named = [n for n, m in self.materials.items() if (m["type"] == "emissive") == lamp]
        return str(self.draw.pick(named)) if named and (lamp or self.draw.chance(0.9)) else None

    # ---- shapes ---------------------------------------------------------------------------------

    def _pool(self) -> list[str]:
        known = types("shape")
        pool = [*self.wanted.get("shape", ()), *self._some("shape", 1, 5)]
        solids = any(issubclass(known[k], Solid) for k in self.wanted.get("shape", ()))
        if not solids and not self.draw.chance(WITH_SOLIDS):
            pool = [k for k in pool if not issubclass(known[k], Solid)]
        return pool or ["sphere", "box"]

    def _shapes(self) -> list[Data]:
        draw = self.draw
        pool = self._pool()
        if "instance" in pool:
            self._add_groups([k for k in pool if k != "instance"] or ["sphere", "box"])
        count = max(len(pool), int(draw.rng.integers(2, 9)))
        found = []
        for k in range(count):
            kind = pool[k] if k < len(pool) else draw.pick(pool)
            found.append(self._shape(kind, REACH, draw.between(0.4, 1.0)))
        found = [one for one in found if one]
        if draw.chance(0.5):
            found.append(self._floor())
        draw.rng.shuffle(found)
        return found

    def _shape(self, kind: str, reach: float, size: float) -> Data:
        try:
            found = parts.shape(self.draw, kind, self.names, self.folder)
        except RefusedError:
            return {}
        material = self._material()
        if material is not None and kind != "instance":
            found["material"] = material
        found["transform"] = parts.placement(self.draw, reach, size)
        return found

    def _add_groups(self, pool: list[str]) -> None:
        """One to three groups; later ones have instances of earlier ones."""
        for k in range(int(self.draw.rng.integers(1, 4))):
            members = [
                self._shape(self.draw.pick(pool), 0.7, 0.6)
                for _ in range(int(self.draw.rng.integers(1, 4)))
            ]
            if k > 0 and self.draw.chance(0.6):
                members.append(self._shape("instance", 0.7, 0.8))
            members = [one for one in members if one and self._can_be_copied(one)]
            if members:
                self.groups[f"g{k}"] = members
                self.names.groups.append(f"g{k}")

    def _can_be_copied(self, member: Data) -> bool:
        """Whether a group may have the shape: an infinite one it may not."""
        scene: Data = {"materials": self.materials, "textures": self.textures}
        scene["groups"] = {**self.groups, "new": [member]}
        return parts.is_valid(
            scene | {"shapes": [{"type": "instance", "group": "new"}]}, self.folder
        )

    def _floor(self) -> Data:
        kind = self.draw.pick(("plane", "rectangle", "disk", "box"))
        found: Data = {"type": kind}
        material = self._material()
        if material is not None:
            found["material"] = material
        up = {"rotate": {"axis": [1.0, 0.0, 0.0], "degrees": -90.0}}
        size: list[Data] = [] if kind == "plane" else [{"scale": [6.0, 6.0, 0.5]}]
        below = {"translate": [0.0, self.draw.between(-3.0, -1.5), 0.0]}
        found["transform"] = [*size, up, below]
        return found

    # ---- media ----------------------------------------------------------------------------------

    def _wants_media(self) -> bool:
        return any(of_media(kind, name) for kind, names in self.wanted.items() for name in names)

    def _has_media(self, scene: Data) -> bool:
        is_path = scene["integrator"]["type"] == "path" and scene["sampler"]["type"] != "grid"
        return is_path and (self._wants_media() or self.draw.chance(WITH_MEDIA))

    def _with_media(self, scene: Data) -> Data:
        """The scene with one to three media, most of them in shapes, some of which are no surface
        then.  Shapes need not be closed: a way out of a medium there is none in both renderers."""
        draw, kinds = self.draw, [*self.wanted.get("phase", ())]
        count = max(len(kinds), int(draw.rng.integers(1, 4)))
        media = {f"v{k}": parts.medium(draw, kinds[k : k + 1]) for k in range(count)}
        materials = {**scene.get("materials", {}), NO_SURFACE[1]: {"type": NO_SURFACE[1]}}
        lamps = [name for name, one in materials.items() if one["type"] == "emissive"]
        solid = [*scene.get("shapes", ()), *(s for g in self.groups.values() for s in g)]
        solid = [one for one in solid if one["type"] not in ("instance", "plane")]
        chosen = [one for one in solid if draw.chance(0.5)] or solid[:1]
        for one in chosen:
            sides = draw.pick((["interior"], ["interior"], ["exterior"], ["interior", "exterior"]))
            one |= {side: draw.pick([*media]) for side in sides}
            if one.get("material") not in lamps and draw.chance(0.6):
                one["material"] = NO_SURFACE[1]
        if draw.chance(0.2):
            scene["camera"]["medium"] = draw.pick([*media])
        return scene | {"media": media, "materials": materials}

    # ---- lights ---------------------------------------------------------------------------------

    def _lights(self, integrator: Data, shapes: list[Data]) -> list[Data]:
        """Lights that are no shapes; most scenes have one that nothing hides."""
        draw = self.draw
        has_lamp = any(m["type"] == "emissive" for m in self.materials.values())
        if has_lamp:
            shapes += [self._lamp() for _ in range(int(draw.rng.integers(1, 4)))]
        kinds = [*self.wanted.get("light", ())]
        if not has_lamp or draw.chance(0.7):
            kinds += self._some("light", 1, 3)
        found, skies = [], 0
        for kind in kinds:
            is_sky = kind in GROUPS["sky"]
            skies += is_sky
            if not is_sky or skies == 1:
                found.append(parts.light(draw, kind, self.names))
        if not _is_lit(integrator, found) and draw.chance(0.7):
            sure = "point" if integrator["type"] == "whitted" else "constant"
            found.append(parts.light(draw, sure, self.names))
        return found

    def _lamp(self) -> Data:
        draw = self.draw
        place = draw.between(2.5, 4.0) * parts.direction(draw, 0.0)
        kind = draw.pick([k for k in self._some("shape", 16, 16) if _can_stand_before(k)])
        size = draw.between(0.02, 0.1) if draw.extreme and draw.chance(0.3) else 0.5
        try:
            found = parts.shape(draw, kind, self.names, self.folder)
        except RefusedError:
            found = {"type": "sphere"}
        steps = parts.facing(draw, place, draw.vector(0.5), size * draw.between(0.5, 1.6))
        return found | {"material": self._material(lamp=True), "transform": steps}


def _can_stand_before(kind: str) -> bool:
    """Whether a lamp of this type of shape is small, and is lit as a light: no plane, no copy, no
    solid."""
    return not issubclass(types("shape")[kind], Solid | Instance | Plane)


def _is_lit(integrator: Data, lights: list[Data]) -> bool:
    """Whether lights are there that hardly any scene hides from the camera: a sky, but for Whitted
    ray tracing, which samples no sky, a light from a point or a direction."""
    kinds = {one["type"] for one in lights}
    if integrator["type"] == "whitted":
        return bool(kinds & {"point", "directional"})
    return bool(kinds & {*GROUPS["sky"]})


def _bases(cls: Any) -> tuple[str, ...]:
    own: tuple[str, ...] = getattr(cls, "bases", ())
    return own or (("base",) if "base" in cls.model_fields else ())


def _names_image(cls: Any) -> bool:
    """Whether a field must name a texture."""
    return any(
        info.is_required() and info.annotation is str and key not in getattr(cls, "bases", ())
        for key, info in cls.model_fields.items()
    )


# ---- the scene ----------------------------------------------------------------------------------


def generate(seed: int, number: int, grammar: Grammar, folder: Path) -> Data:
    """The scene's data;  folder: of the files that it names (`assets.write`)."""
    draw = Draw(np.random.default_rng([seed, number]), grammar.extreme)
    found = Assembly(draw, _wanted(draw, grammar.features), folder).data()
    if draw.extreme and draw.chance(0.4):
        found = _far(draw, found)
    for _ in range(MENDED):
        if _shows_light(found, number, folder):
            break
        found = _mended(draw, found)
    return found


MENDED = 3
"""Times that a scene whose picture is black is seen from another place."""


def _shows_light(data: Data, number: int, folder: Path) -> bool:
    """Whether a small picture is not black; a scene that cannot be rendered is left as it is, to be
    found."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)
            scene = parse(data, number, folder)
            if isinstance(scene.integrator, RayCast):
                return True
            return bool(render(scene, size=(8, 6), spp=4, threads=1).colour.any())
    except Exception:
        return True


def _mended(draw: Draw, data: Data) -> Data:
    """The scene seen from another side, with a light where the camera is."""
    camera = data["camera"]
    far = float(np.linalg.norm(np.subtract(camera["eye"], camera["target"])))
    toward = far * parts.direction(draw, 0.0)
    eye = [rounded(x) for x in (np.array(camera["target"]) + toward).tolist()]
    camera = camera | {"eye": eye, "up": [0.1, 1.0, 0.2]}
    lamp = {"type": "point", "position": eye, "intensity": rounded(0.6 * far * far)}
    kept = [x for x in data.get("lights", ()) if x.get("position") != data["camera"]["eye"]]
    return data | {"camera": camera, "lights": [*kept, lamp]}


def parse(data: Data, number: int | str, folder: Path) -> Scene:
    """The scene, through its text.  Raises SceneError."""
    return _parsed(text_of(data), f"{number}.yaml", folder)


_parsed = lru_cache(maxsize=1)(Scene.parse)
"""The last one is kept: whether a scene shows light is asked where it is made, and what was built
for that is there when it is checked."""


def _wanted(draw: Draw, features: tuple[str, ...]) -> dict[str, list[str]]:
    """The types that the scene must have, by kind; of a group one type."""
    found: dict[str, list[str]] = {}
    for name in features:
        one = draw.pick(GROUPS[name]) if name in GROUPS else name
        found.setdefault(kind_of(one), []).append(one)
    return found


def _far(draw: Draw, scene: Data) -> Data:
    """The scene, far from the origin or of another size; a camera's lengths too."""
    from comparisons.geometry.frame import Frame
    from comparisons.translator.moved import moved

    size = 2.0 ** int(draw.rng.integers(-12, 13))
    center = (0.0, 0.0, 0.0)
    if draw.chance(0.5):
        far = draw.pick((10.0, 100.0, 1e3, 1e4))
        x, y, z = (rounded(far * x) for x in parts.direction(draw).tolist())
        center = (x, y, z)
    there = moved(Scene.model_validate(scene), Frame(center, size))
    found: Data = json.loads(there.to_json())
    return found
