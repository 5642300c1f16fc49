"""Media: what fills the space between surfaces, and takes and scatters light on its way.

- `phase.py`: phase functions, the angles by which a medium scatters;
- `homogeneous.py`: media that are the same everywhere;
- `tables.py`: the media of a scene as kernels take them, and which medium is on which side of a
  surface.

Contract: colours are linear sRGB; sigma_t, the extinction coefficient, is in 1 / scene unit, and
each colour has its own.  Light that travels the distance t loses the share 1 - exp(-sigma_t t),
of which the part `albedo` is scattered and the rest absorbed (Chandrasekhar 1960, ch. 1).  A phase
function is a density of directions per solid angle (1/sr), whose integral over all directions is 1.

A medium fills the closed space between surfaces that name it.  So which medium a ray is in follows
from the camera's medium and the surfaces that the ray has crossed, never from a position.
"""

from reference_rt.media.homogeneous import Homogeneous as Homogeneous
from reference_rt.media.phase import AnyPhase as AnyPhase
from reference_rt.media.phase import BlendPhase as BlendPhase
from reference_rt.media.phase import HenyeyGreenstein as HenyeyGreenstein
from reference_rt.media.phase import Isotropic as Isotropic
from reference_rt.media.phase import Rayleigh as Rayleigh
from reference_rt.media.tables import Media as Media

AnyMedium = Homogeneous
"""The media of a scene."""
