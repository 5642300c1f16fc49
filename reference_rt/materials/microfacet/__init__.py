"""Fresnel's equations and distributions of microfacets, which BSDFs are made of.

Kernels without tables: they take cosines, indices of refraction and directions of the shading
frame.  `fresnel` takes a signed cosine, negative inside, and the index inside over that outside;
its fractions of power are right to their last digits, so that 1 - F is never computed.  A
`Microfacets` is a distribution at one point, with roughness along x and y; `density` is D(h) per
solid angle and area, `g1` is Smith's masking, from 0 to 1, and `sample_visible` draws normals with
`visible_density`.

To add a distribution: a code in `_KINDS` and a branch in `density`, `g1_over_cos` and
`sample_visible`.
"""
