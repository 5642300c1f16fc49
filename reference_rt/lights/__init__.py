"""Lights: where light comes from, and which light a shadow ray is sent to.

- `emitters/`: the types of lights, one file each;
- `selection/`: the light sampler, by power or by a light tree;
- `tables.py`: the tables of all types;
- `dispatch.py`: the kernels that integrators call, for any light of a scene.

Contract: all positions and directions are in the world; units are W sr^-1 m^-2 for radiance, scene
units for distances; colours are linear sRGB.  Lights that can be sampled are numbered 0, 1, ...

- `pick(lights, p, n, u)` returns a light's number and the probability of picking it;
- `sample_one(lights, k, shapes, textures, p, u0, u1) -> LightSample` returns a direction from `p`
  to light k and the radiance from there, without testing visibility; its pdf does not include the
  probability of picking k; pdf = 0 means that nothing arrives;
- `area_pdf` and `environment_pdf` return the density with which these two find a point that was
  hit, or a direction in which nothing is hit: per solid angle, picking included;
- `background` returns the radiance of a ray that hits nothing.

Shapes whose material is `emissive` are lights too (`emitters/area.py`).

To add a light: a file in `emitters/`, and its lines in `tables.py`.  Step by step:
docs/extending.md.
"""

from reference_rt.lights.dispatch import ambient as ambient
from reference_rt.lights.dispatch import area_pdf as area_pdf
from reference_rt.lights.dispatch import ask_for_light as ask_for_light
from reference_rt.lights.dispatch import background as background
from reference_rt.lights.dispatch import background_of as background_of
from reference_rt.lights.dispatch import backgrounds as backgrounds
from reference_rt.lights.dispatch import count as count
from reference_rt.lights.dispatch import emitted as emitted
from reference_rt.lights.dispatch import environment_density as environment_density
from reference_rt.lights.dispatch import environment_pdf as environment_pdf
from reference_rt.lights.dispatch import is_area as is_area
from reference_rt.lights.dispatch import pick as pick
from reference_rt.lights.dispatch import pick_probability as pick_probability
from reference_rt.lights.dispatch import picked_in as picked_in
from reference_rt.lights.dispatch import sample_asked as sample_asked
from reference_rt.lights.dispatch import sample_fixed as sample_fixed
from reference_rt.lights.dispatch import sample_one as sample_one
from reference_rt.lights.emitters.area import Areas as Areas
from reference_rt.lights.emitters.constant import Environment as Environment
from reference_rt.lights.emitters.environment_map import EnvironmentMaps as EnvironmentMaps
from reference_rt.lights.light import LIGHT_FLOATS as LIGHT_FLOATS
from reference_rt.lights.light import LIGHT_INTEGERS as LIGHT_INTEGERS
from reference_rt.lights.light import NO_LIGHT as NO_LIGHT
from reference_rt.lights.light import Background as Background
from reference_rt.lights.light import LightBlock as LightBlock
from reference_rt.lights.light import LightSample as LightSample
from reference_rt.lights.light import ask_for_no_light as ask_for_no_light
from reference_rt.lights.light import background_in as background_in
from reference_rt.lights.light import light_of as light_of
from reference_rt.lights.light import shadow_ray as shadow_ray
from reference_rt.lights.selection.choice import LightSampler as LightSampler
from reference_rt.lights.selection.choice import Pick as Pick
from reference_rt.lights.tables import *
