"""Notes for the reader on what Mitsuba lacks or gets wrong: of materials and of integrators."""

from comparisons.lights.translate import (
    counts_lights_often,
    drops_light,
    misplaces,
    squares_opacity,
)
from comparisons.materials import type_of
from comparisons.mitsuba.context import TranslationContext
from comparisons.translator.accuracy import accuracy
from reference_rt.integrators import Direct
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
    return list(dict.fromkeys(note for note in notes if note))


def notes_of_integrator(scene: Scene) -> list[str]:
    """The notes on errors of Mitsuba's integrators."""
    notes = (
        *(note_of_samples(scene), note_of_masks(scene), note_of_passing(scene)),
        note_of_hiding(scene),
    )
    return [note for note in notes if note]


def note_of_passing(scene: Scene) -> str:
    """The note on Mitsuba's error that `drops_light` describes; empty without it."""
    if not drops_light(scene):
        return ""
    return (
        "without an environment Mitsuba's path tracer drops the light of lamps that let light pass "
        "straight through: its scene has a black environment"
    )


def note_of_masks(scene: Scene) -> str:
    """The note on Mitsuba's error that `squares_opacity` describes; empty without it."""
    if not squares_opacity(scene):
        return ""
    return (
        "Mitsuba's path tracer multiplies samples of lights by the opacity of a mask twice; our "
        "own, which runs in Mitsuba, takes its place"
    )


def note_of_hiding(scene: Scene) -> str:
    """The note on Mitsuba's error that `misplaces` describes; empty without it."""
    if not misplaces(scene):
        return ""
    return (
        "Mitsuba misplaces what lies behind hidden lamps unless it is a mesh; our own integrator, "
        "which runs in Mitsuba, takes the place of its own"
    )


def note_of_samples(scene: Scene) -> str:
    """The note on Mitsuba's error that `counts_lights_often` describes; empty without it."""
    if not counts_lights_often(scene):
        return ""
    assert isinstance(scene.integrator, Direct)
    return (
        "Mitsuba's direct illumination adds up its samples of lights without extent, which it "
        f"should average: with {scene.integrator.light_samples} of them these lights are as many "
        "times too bright; compared with one sample, for which it is right"
    )


def note_of(material: Material, context: TranslationContext) -> str:
    """The note on a material; empty if Mitsuba's own material is its exact counterpart."""
    note = type_of(material).note
    return "" if note is None else note(material, context)
