"""A small scene with lights of every kind, for tests of queries."""

LIT = """
integrator: {type: whitted}
textures:
  checks: {type: checker, first: [0.8, 0.7, 0.2], second: [0.1, 0.2, 0.3], uv: {scale: [6, 4]}}
materials:
  grey: {type: diffuse, reflectance: checks}
  silver: {type: mirror, reflectance: 0.9}
  lamp: {type: emissive, radiance: [5, 4, 3], base: grey}
shapes:
  - {type: rectangle, material: grey, transform: [{scale: 3}, {translate: [0, 0, -2]}]}
  - {type: sphere, radius: 0.7, material: silver}
  - {type: rectangle, material: lamp,
     transform: [{rotate: {axis: [0, 1, 0], degrees: 70}}, {translate: [-2.5, 0, 1]}]}
lights:
  - {type: ambient, radiance: 0.1}
  - {type: constant, radiance: [0.1, 0.2, 0.3]}
  - {type: directional, direction: [0, -1, -1], irradiance: [1, 2, 3]}
  - {type: point, position: [2, 3, 3], intensity: [9, 8, 7]}
"""
"""Has no camera: that of the description's default, or of the test that adds one."""
