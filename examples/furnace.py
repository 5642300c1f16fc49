"""A white furnace: what loses no light is invisible under a uniform sky."""

import reference_rt as rt

for alpha in (0.05, 0.2, 0.5):
    scene = rt.Scene(
        camera=rt.Perspective(eye=(0, 0, 4), target=(0, 0, 0), fov=20),
        film=rt.Film(width=24, height=24),
        sampler=rt.Sobol(spp=256),
        integrator=rt.Path(max_depth=None),
        materials={"glass": rt.RoughDielectric(alpha=alpha)},
        shapes=(rt.Sphere(material="glass"),),
        lights=(rt.Constant(radiance=1.0),),
    )
    seen = rt.render(scene).colour[8:16, 8:16].mean()
    print(f"rough glass, alpha {alpha}: {1.0 - seen:.1%} of the light is lost between the facets")
