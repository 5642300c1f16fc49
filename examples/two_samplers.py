"""Error against run time of two samplers."""

import numpy as np

from reference_rt import Independent, Scene, Sobol, render

scene = Scene.load("scenes/cornell_box.yaml")
size = (32, 32)
exact = render(scene.changed(sampler=Sobol(spp=2048, seed=99)), size=size).colour

print("samples   seconds: independent, Sobol'   error: independent, Sobol'")
for spp in (16, 64, 256):
    seconds, errors = [], []
    for sampler in (Independent, Sobol):
        picture = render(scene.changed(sampler=sampler(spp=spp, seed=1)), size=size)
        seconds.append(picture.seconds["render"])
        errors.append(np.sqrt(((picture.colour - exact) ** 2).mean()) / exact.mean())
    print(f"{spp:7}   {seconds[0]:.3f} {seconds[1]:.3f}   {errors[0]:.1%} {errors[1]:.1%}")
