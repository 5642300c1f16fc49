"""Every case by ours, with and without a planted fault; some by Mitsuba."""

from pathlib import Path

import pytest

from comparisons.renderers import other
from comparisons.truth.case import cases
from comparisons.truth.judge import judge
from comparisons.truth.renderers import by, load, ours
from reference_rt.rendering.scene import Scene

SCENES = Path(__file__).parents[3] / "scenes" / "truth"
CASES = cases()

FAULTS = (
    # rays and cameras
    ("perspective", "fov: 40", "fov: 40.3"),
    ("perspective", "eye: [0.3,", "eye: [0.31,"),
    ("perspective_fov_y", "fov_axis: y", "fov_axis: x"),
    ("perspective_rolled", "up: [1, 2,", "up: [1.05, 2,"),
    ("perspective_sheared", "-0.45, 0.35", "-0.35, 0.45"),
    ("pinhole_film", "film_distance: 0.5", "film_distance: 0.505"),
    ("pinhole_blur", "hole_radius: 0.04", "hole_radius: 0.044"),
    ("pinhole_exposure", "hole_radius: 0.3", "hole_radius: 0.301"),
    ("pinhole_exposure", "film_width: 2", "film_width: 2.02"),
    ("orthographic", "width: 3.4", "width: 3.42"),
    ("clipped", "near: 3.4", "near: 3.41"),
    ("clipped", ", far: 4.75", ""),
    ("sphere_outline", "radius: 0.7", "radius: 0.702"),
    ("box_outline", "degrees: 25", "degrees: 26"),
    ("depth_of_plane", "type: perspective, eye: [0, 0, 2]", "type: perspective, eye: [0, 0, 2.01]"),
    ("depth_of_sphere", "radius: 1", "radius: 1.001"),
    ("sphere_normals", "radius: 1", "radius: 1.001"),
    ("torus_normals", "minor_radius: 0.5", "minor_radius: 0.505"),
    ("cone_normals", "height: 1.2", "height: 1.21"),
    ("cylinder_normals", "radius: 0.8", "radius: 0.801"),
    ("paraboloid_normals", "0.7, 0.7, 0, 0", "0.7, 0.71, 0, 0"),
    ("lens_blur", "aperture_radius: 0.2", "aperture_radius: 0.22"),
    ("lens_focus", "target: [0, 0, 0]", "target: [0, 0, 2]"),
    # photometry
    ("point_over_floor", "0.3, 1]", "0.3, 1.005]"),
    ("point_over_slope", "degrees: 40", "degrees: 40.1"),
    ("three_points", "intensity: [0.2, 0.2, 0]", "intensity: [0.2, 0.22, 0]"),
    ("measured_lamp", "[1, 0.3, 0.5]", "[1, 0.303, 0.5]"),
    ("measured_lamp", "c0: [1, 0, 0]", "c0: [1, 0.01, 0]"),
    ("spot_falloff", "beam_width: 10", "beam_width: 11"),
    ("spot_falloff", "cutoff_angle: 25", "cutoff_angle: 25.2"),
    ("projector", "aspect: 1.5", "aspect: 1.49"),
    ("directional_on_roof", "direction: [-0.5", "direction: [-0.501"),
    ("disk_lamp", "scale: 0.9", "scale: 0.901"),
    ("rectangle_lamp", "degrees: 210", "degrees: 211"),
    ("triangle_lamp", "v2: [-1, 1.5", "v2: [-1.02, 1.5"),
    ("box_lamp", "scale: 0.5", "scale: 0.502"),
    ("sphere_lamp", "radius: 0.8", "radius: 0.801"),
    ("setting_sphere", "radius: 1", "radius: 1.002"),
    ("tube_lamp", "radius: 0.2", "radius: 0.202"),
    ("checkered_lamp", "second: [0.5", "second: [0.51"),
    ("three_lamps", "radiance: [2, 0.1", "radiance: [2.1, 0.1"),
    ("lamp_back", "translate: [0.75, 0, 1]}]", "rotate: {axis: [1, 0, 0], degrees: 170}}]"),
    ("harmonic_sky", "harmonic_sky.exr", "harmonic_sky.exr, scale: 1.001"),
    # materials
    ("diffuse_furnace", "0.5, 0.2]", "0.502, 0.2]"),
    ("mirror_furnace", "0.6, 0.3]", "0.602, 0.3]"),
    ("glass_furnace", "interior_ior: 1.5", "interior_ior: 1.5, transmittance: 0.9999"),
    ("metal_furnace", "eta: [0.14", "eta: [0.141"),
    ("glass_reflection", "interior_ior: 1.5", "interior_ior: 1.51"),
    ("glass_boundary", "interior_ior: 1.5", "interior_ior: 1.502"),
    ("glass_from_inside", "interior_ior: 1.5", "interior_ior: 1.501"),
    ("pane_reflection", "thin_dielectric", "dielectric"),
    ("pane_transmission", "interior_ior: 1.5", "interior_ior: 1.51"),
    ("stack_of_panes", "interior_ior: 1.5", "interior_ior: 1.51"),
    ("slab", "interior_ior: 1.5", "interior_ior: 1.505"),
    ("facing_mirrors", "max_depth: 12", "max_depth: 11"),
    ("retro_reflector", "0.8, 0.7]", "0.802, 0.7]"),
    ("ggx_in_light", "distribution: ggx", "distribution: beckmann"),
    ("beckmann_in_light", "alpha: 0.4", "alpha: 0.401"),
    ("phong_in_light", "specular: 0.1", "specular: 0.1, half_vector: true"),
    ("blinn_in_light", "exponent: 40", "exponent: 40.2"),
    ("ggx_furnace", "alpha: 0.3", "alpha: 0.31"),
    ("beckmann_furnace", "distribution: beckmann", "distribution: ggx"),
    ("rough_boundary", "alpha: 0.3", "alpha: 0.32"),
    ("plastic_furnace", "nonlinear: true", "nonlinear: false"),
    ("plastic_dense_furnace", "interior_ior: 2.4", "interior_ior: 2.42"),
    ("rough_plastic_furnace", "alpha: 0.3", "alpha: 0.32"),
    ("blend_furnace", "weight: 0.3", "weight: 0.302"),
    ("mask_furnace", "opacity: 0.4", "opacity: 0.402"),
    ("mask_in_light", "opacity: 0.5", "opacity: 0.501"),
    ("two_sides", "back: back", "back: front"),
    # visibility
    ("shadow_of_sphere", "radius: 0.5", "radius: 0.502"),
    ("shadow_of_triangle", "v2: [0, 0.5", "v2: [0.02, 0.5"),
    ("penumbra_of_edge", "translate: [30,", "translate: [30.01,"),
    ("penumbra_of_disk", "type: disk", "type: rectangle"),
    ("wall_under_sky", "scale: [0.75,", "scale: [0.74,"),
    ("sphere_under_sky", "radius: 0.5", "radius: 0.502"),
    ("hole_in_screen", "[0.4, 0.4, 1]", "[0.4, 0.41, 1]"),
    ("disk_under_sky", "scale: 0.5", "scale: 0.505"),
    ("narrow_gap", "translate: [30,", "translate: [30.01,"),
    # transport
    ("closed_room", "type: path", "type: path, max_depth: 12"),
    ("path_lengths", "max_depth: 4", "max_depth: 5"),
    ("sphere_in_sphere", "radius: 3", "radius: 3.01"),
    ("canyon", "reflectance: [0.7", "reflectance: [0.705"),
    ("wall_to_floor", "0.6, 0.9]", "0.61, 0.9]"),
    ("mirror_image", "0.8, 0.7]", "0.82, 0.7]"),
    ("caustic", "-0.64", "-0.6"),
    ("window", "interior_ior: 1.5", "interior_ior: 1.53"),
    # recursive ray tracing
    ("whitted_depth", "max_depth: 12", "max_depth: 11"),
    ("whitted_ambient", "radiance: 1.5", "radiance: 1.502"),
    ("whitted_ambient", "[0.05, 0.2, 0.4]", "[0.05, 0.202, 0.4]"),
    ("whitted_lit_mirror", "exponent: 5", "exponent: 5.02"),
    ("whitted_lit_mirror", "[-2, -1, 0]", "[-2, -1.01, 0]"),
    ("whitted_in_glass", "interior_ior: 1.6", "interior_ior: 1.601"),
    ("whitted_union", "interior_ior: 1.5", "interior_ior: 1.502"),
    ("whitted_union", "-0.25]", "-0.35]"),
    ("whitted_quadric", "0.5, -0.4", "0.502, -0.4"),
    ("whitted_quadric", "exponent: 12", "exponent: 12.1"),
    # solids, instances, meshes
    ("solid_room", "max_depth: 4", "max_depth: 3"),
    ("lamp_on_solid", "scale: 0.8", "scale: 0.802"),
    ("drilled_box", "radius: 0.55", "radius: 0.551"),
    ("two_balls_common", "[0.4, 0.1, 0]", "[0.402, 0.1, 0]"),
    ("ball_and_box", "type: union", "type: difference"),
    ("bitten_box", "radius: 1.25", "radius: 1.2505"),
    ("solid_lens", "interior_ior: 1.5", "interior_ior: 1.504"),
    ("sheared_ball", "0.4, 0.1]", "0.41, 0.1]"),
    ("three_copies", "degrees: 40", "degrees: 42"),
    ("mesh_normals", "faces:", "face_normals: true\n    faces:"),
    ("mesh_colours", "[0.9, 0.8, 0.1]", "[0.9, 0.81, 0.1]"),
    ("star_even_odd", "even_odd\n", "nonzero\n"),
    ("star_nonzero", "nonzero\n", "even_odd\n"),
    ("checker_map", "offset: [0.1", "offset: [0.102"),
    # signal
    ("box_filter", "type: box", "type: tent, radius: 0.55"),
    ("tent_filter", "tent, radius: 1", "gaussian, stddev: 0.4"),
    ("gaussian_filter", "stddev: 0.5", "stddev: 0.52"),
    ("mitchell_filter", "type: mitchell", "type: mitchell, b: 0.5"),
    ("catmull_rom_filter", "catmull_rom", "mitchell"),
    ("lanczos_filter", "lobes: 3", "lobes: 2"),
    ("grating", "scale: [32.4", "scale: [32.42"),
    ("wedges", "width: 32}", "width: 32.1}"),
    # media
    ("smoke_slab", "[0.6, 1.2, 2.4]", "[0.6, 1.202, 2.4]"),
    ("smoke_ball", "radius: 1", "radius: 1.002"),
    ("smoke_box", "degrees: 35", "degrees: 35.5"),
    ("smoke_in_row", "0, -0.3]", "0, -0.301]"),
    ("smoke_in_smoke", "scale: 3", "scale: 3.01"),
    ("smoke_in_smoke", "inner, exterior: outer", "inner"),
    ("lamp_through_smoke", ", medium: smoke", ""),
    ("floor_in_smoke", "sigma_t: [0.6", "sigma_t: [0.602"),
    ("lamp_in_smoke", "2.4]", "2.405]"),
    ("floor_under_smoke", "interior: smoke", "exterior: smoke"),
    ("ink_in_glass", "interior_ior: 1.5", "interior_ior: 1.51"),
    ("stained_slab", "1000, 0.25]}", "1000, 0.251]}"),
    ("white_fog", "[4, 2, 1], albedo: 1", "[4, 2, 1], albedo: 0.99"),
    ("milk_in_glass", "albedo: 1", "albedo: 0.999"),
    ("foggy_room", "albedo: 1", "albedo: 0.998"),
    # scattering
    ("sun_on_fog", "max_depth: 2", "max_depth: 3"),
    ("sun_on_air", "type: rayleigh", "type: isotropic"),
    ("sun_on_frost", "g: -0.5", "g: -0.505"),
    ("sun_through_haze", "g: 0.7", "g: 0.703"),
    ("sun_through_dust", "weight: 0.3", "weight: 0.303"),
    ("sun_over_camera", "eye: [0, 0, -0.5]", "eye: [0, 0, -0.51]"),
    ("shadow_in_fog", "translate: [1000,", "translate: [1000.01,"),
    ("point_in_fog", "[0.9, 0.9, 0.3]", "[0.9, 0.91, 0.3]"),
    ("endless_fog", "albedo: [0.9", "albedo: [0.905"),
    ("point_by_ball", "1.1], intensity", "1.11], intensity"),
    ("ball_of_fog", "sigma_t: [0.5", "sigma_t: [0.52"),
    ("ball_of_milk", "0.999]", "0.998]"),
    # half spaces and slabs
    ("half_space_sun_1", "albedo: [0.5", "albedo: [0.503"),
    ("half_space_sun_2", "0.999]", "0.9985]"),
    ("half_space_sun_3", "0.6, 0.9]", "0.603, 0.9]"),
    ("half_space_sun_4", "0.98]", "0.981]"),
    ("half_space_sun_5", "0.995]", "0.996]"),
    ("half_space_sun_6", ", -0.1]", ", -0.101]"),
    ("half_space_sky_1", "0.95]", "0.952]"),
    ("half_space_sky_2", "albedo: [0.9", "albedo: [0.903"),
    ("half_space_sky_3", "albedo: [0.3", "albedo: [0.303"),
    ("half_space_sky_4", "albedo: [0.98", "albedo: [0.982"),
    ("half_space_sky_5", "0.97]", "0.972]"),
    ("half_space_sky_6", "0.85]", "0.855]"),
    ("slab_sun_1", "albedo: [0.9, 0.6", "albedo: [0.9, 0.605"),
    ("slab_sun_2", "g: -0.5", "g: 0.5"),
    ("slab_sun_3", "g: 0.3", "g: 0.31"),
    ("slab_sun_4", "g: 0.5", "g: 0.51"),
    ("slab_sun_5", "sigma_t: [1,", "sigma_t: [1.02,"),
    ("slab_sun_6", "g: 0.9", "g: 0.89"),
    ("slab_sun_7", "g: -0.3", "g: -0.31"),
    ("slab_sun_8", "albedo: [0.9,", "albedo: [0.91,"),
    ("slab_sun_9", "g: 0.8", "g: 0.805"),
    ("slab_sun_10", "g: 0.9", "g: 0.905"),
    ("slab_sun_11", ", phase: {type: rayleigh}", ""),
    ("slab_sun_12", "weight: 0.3", "weight: 0.31"),
    ("slab_sky_1", "albedo: [0.99", "albedo: [0.98"),
    ("slab_sky_2", "g: 0.5", "g: 0.51"),
    ("slab_sky_3", "g: 0.9", "g: 0.895"),
    ("slab_sky_4", "3]", "3.05]"),
    ("slab_sky_5", "0.99, 0.8]", "0.99, 0.805]"),
    ("slab_sky_6", "0.999]", "0.997]"),
)
"""(case, what its scene says, what it says in place of that): a fault that the case is meant for,
as small as it should see it."""


@pytest.mark.cases(14)
@pytest.mark.parametrize("name", CASES)
def test_ours_is_right(name):
    """With the scene's samples; its noise is known to a tenth of a percent of the picture."""
    found = judge(CASES[name].compute(), ours(load(SCENES / f"{name}.yaml")))
    assert found.verdict == "right", found
    assert found.power < 0.1


@pytest.mark.cases(14)
@pytest.mark.parametrize(("name", "right", "wrong"), FAULTS)
def test_a_planted_fault_is_seen(name, right, wrong):
    text = (SCENES / f"{name}.yaml").read_text()
    assert right in text
    scene = Scene.parse(text.replace(right, wrong), folder=SCENES)
    assert judge(CASES[name].compute(), ours(scene)).verdict == "off"


def test_mitsuba():
    """Right where it is exact; its own plugins and integrators are judged, whose path tracer takes
    the opacity of a mask twice, and whose blends lose light of mirrors."""
    found = {
        name: judge(CASES[name].compute(), by(other("mitsuba"), load(SCENES / f"{name}.yaml", 64)))
        for name in ("perspective", "point_over_floor", "mask_in_light", "blend_furnace")
    }
    assert {name: one.verdict for name, one in found.items()} == {
        "perspective": "right",
        "point_over_floor": "right",
        "mask_in_light": "off",
        "blend_furnace": "off",
    }
    assert -51.0 < found["mask_in_light"].percent < -49.0
