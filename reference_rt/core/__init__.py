"""What all folders above share: vectors, rays, transforms, the base of scene descriptions, images.

For kernels (compiled; NamedTuples of float64, world units, nothing allocated):

- `vec3.py` (`Vec3`, `Frame`), `ray.py` (`Ray`, `Hit`, `SurfacePoint`, and the one policy for
  leaving a surface; SoA blocks of rays and hits)

For Python:

- `arrays.py` (array types), `transform.py` (affine maps (3, 4); degrees)
- `model.py` (`Description`, the frozen pydantic base of everything in a scene file, field types
  and arrays in descriptions), `diagnosis.py` (pydantic's errors as one line)
- `exr.py` and `image_files/` (image files: linear values, row 0 on top)

To add a field type: an `Annotated` type in `model.py` whose validator raises ValueError("expected
..."), with its JSON Schema; `diagnosis.py` adds the keys.
"""
