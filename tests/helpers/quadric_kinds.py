"""Quadrics of every kind: by coefficients, ellipsoids, cylinders, cones and frustums."""

import reference_rt as rt

BOX = {"lower": (-1.0, -1.0, -1.0), "upper": (1.0, 1.0, 1.0)}


def quadric_of(*coefficients, capped=False, **box):
    return rt.Quadric(coefficients=coefficients, capped=capped, **(box or BOX))


def open_and_capped(*coefficients, **box):
    return [quadric_of(*coefficients, capped=capped, **box) for capped in (False, True)]


ELLIPSOIDS = [rt.Sphere(), rt.Sphere(center=(0.3, -0.2, 0.7), radius=1.7)]
KINDS = {
    "ellipsoid": ELLIPSOIDS,
    "ellipsoid by coefficients": open_and_capped(2, 3, 4, 0.5, -0.3, 0.2, 0.1, 0.2, -0.3, -1),
    "elliptic cylinder": open_and_capped(1, 2, 0, 0, 0, 0, 0, 0, 0, -0.5),
    "double cone": [
        *open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0),
        quadric_of(-1, -1, 1, 0, 0, 0, 0, 0, 0, 0, capped=True),
    ],
    "paraboloid": open_and_capped(1, 1.3, 0, 0, 0, 0, 0.1, 0, -1, -0.3),
    "saddle": open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, -1, 0),
    "hyperboloid of one sheet": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, -0.2),
    "hyperboloid of two sheets": open_and_capped(1, 1, -1, 0, 0, 0, 0, 0, 0, 0.2),
    "turned, off the middle": open_and_capped(
        *(1, 0.5, 0.7, -0.3, 0.2, 0.9, 0.3, -0.4, 0.2, -0.3),
        lower=(-1.3, -0.8, -0.2),
        upper=(0.8, 2.1, 1.0),
    ),
    "plane by coefficients": open_and_capped(0, 0, 0, 0, 0, 0, 1, 2, 3, 0.25),
    "pair of planes": [
        *open_and_capped(1, -1, 0, 0, 0, 0, 0, 0, 0, 0),
        *open_and_capped(1, 0, 0, 0, 0, 0, 0, 0, 0, -0.25),
    ],
    "box by coefficients": [quadric_of(0, 0, 0, 0, 0, 0, 0, 0, 0, -1, capped=True)],
    "cylinder": [rt.Cylinder(), rt.Cylinder(radius=0.3, z_min=-2.0, z_max=0.7)],
    "tube": [rt.Cylinder(capped=False), rt.Cylinder(radius=3, z_min=-2, z_max=0.7, capped=False)],
    "cone": [rt.Cone(), rt.Cone(radius=0.7, height=2.1), rt.Cone(radius=3, height=0.1)],
    "open cone": [rt.Cone(capped=False), rt.Cone(radius=0.7, height=2.1, capped=False)],
    "frustum": [
        rt.Cone(top_radius=0.3),
        rt.Cone(radius=0.5, top_radius=1.3, height=0.7),
        rt.Cone(top_radius=0.9999),
        rt.Cone(top_radius=1.0),
    ],
    "open frustum": [rt.Cone(top_radius=0.3, capped=False)],
}
TURNED = ("cylinder", "tube", "cone", "open cone", "frustum", "open frustum")
