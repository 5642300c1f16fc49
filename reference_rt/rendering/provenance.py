"""What a picture was made of, for the headers of files."""

import importlib.metadata

from reference_rt.scene.model import SceneModel


def provenance(scene: SceneModel) -> dict[str, str]:
    """The provenance of a picture, for its header: the same scene has the same bytes."""
    return {
        "software": f"reference_rt {importlib.metadata.version('reference-rt')}",
        "scene": scene.name,
        "sceneSha256": scene.digest(),
        "integrator": scene.integrator.model_dump_json(),
        "sampler": scene.resolved_sampler.model_dump_json(),
        "filter": scene.film.filter.model_dump_json(),
    }
