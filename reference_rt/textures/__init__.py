"""Textures, one module each, and the material parameters that may be textures (`parameter.py`).

A texture gives a linear sRGB colour, or through its luminance a number, for surface coordinates
(u, v).  Its module has a `Texture` with `tabulate(folder)`, which returns one row of its table;
the table, a NamedTuple; `greatest(table)`, the largest value in it, by which parameters check their
range; and, where it depends on (u, v), `lookup(table, row, u, v)`, after the texture's uv map.

To add a texture: its module, and its lines in `tables.py`.
"""

from reference_rt.textures.lookup import NOWHERE as NOWHERE
from reference_rt.textures.lookup import At as At
from reference_rt.textures.lookup import OnTriangle as OnTriangle
from reference_rt.textures.parameter import NO_TEXTURES as NO_TEXTURES
from reference_rt.textures.parameter import ColourParameter as ColourParameter
from reference_rt.textures.parameter import Colours as Colours
from reference_rt.textures.parameter import Numbers as Numbers
from reference_rt.textures.parameter import Palette as Palette
from reference_rt.textures.parameter import ReflectanceParameter as ReflectanceParameter
from reference_rt.textures.parameter import TextureName as TextureName
from reference_rt.textures.parameter import UnitParameter as UnitParameter
from reference_rt.textures.parameter import colour_at as colour_at
from reference_rt.textures.parameter import number_at as number_at
from reference_rt.textures.parameter import texture_names as texture_names
from reference_rt.textures.tables import *
from reference_rt.textures.texture import Texture as Texture
