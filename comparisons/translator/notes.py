"""Notes for the reader on what Mitsuba lacks or gets wrong: of materials and of integrators."""

from comparisons.materials import type_of
from comparisons.mitsuba.context import TranslationContext
from comparisons.translator.accuracy import accuracy
from comparisons.translator.mistakes import ROULETTE, in_place_of, notes_of_integrator
from reference_rt.integrators import Path
from reference_rt.materials import Material
from reference_rt.rendering.scene import Scene


def notes_of(scene: Scene) -> list[str]:
    """The notes on a scene's materials, each text once."""
    context = TranslationContext.of(scene)
    notes = [note_of(material, context) for material in scene.materials.values()]
    for name in scene.materials:
        off = accuracy(scene, name)
        if off > 0.0:
            notes.append(
                f"'{name}': a relative error of {off:.2g} of its light is allowed for (tables, "
                "float32: comparisons.translator.accuracy)"
            )
    notes += notes_of_integrator(scene)
    if scene.has_media and isinstance(scene.integrator, Path) and in_place_of(scene) is None:
        notes.append(ROULETTE)
    return list(dict.fromkeys(note for note in notes if note))


def note_of(material: Material, context: TranslationContext) -> str:
    """The note on a material; empty if Mitsuba's own material is its exact counterpart."""
    note = type_of(material).note
    return "" if note is None else note(material, context)
