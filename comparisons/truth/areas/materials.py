"""Materials: what surfaces send back of a sky of one colour, or of a light.

Under a sky that is the same everywhere a surface sends back the sky times its albedo in the
direction of view."""

from collections.abc import Callable

import numpy as np

from comparisons.truth.case import Expected, FloatArray, case, derivative
from comparisons.truth.film import View, coverage, level, mix, pixel_means, seen_from_above, turn
from comparisons.truth.optics import (
    fresnel,
    fresnel_metal,
    fresnel_rate,
    half_vector_mean,
    rough_metal,
)

SKY = np.array([0.5, 1.0, 2.0])
RHO = np.array([0.8, 0.5, 0.2])
GOLD = ((0.14, 3.98), (0.37, 2.38), (1.44, 1.6))
GOLD_ETA = np.array([eta for eta, _ in GOLD])
"""(eta, k) of red, green and blue."""

Albedo = Callable[[FloatArray], FloatArray]
"""Of cosines (...), (...) or (..., 3)."""

WIDTH = 2.4
FRESNEL = "Fresnel's equations"


def _ball(albedo: Albedo, bound: float = 1e-9, sky: float = 1.0) -> Expected:
    """A unit sphere in the sky: pixels within 0.9 of the radius by the albedo, pixels outside of it
    by the sky, times `sky`."""

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        r2 = x * x + y * y
        values = np.asarray(albedo(np.sqrt(1.0 - np.minimum(r2, 0.81))))
        values = values[..., None] if values.ndim == 2 else values
        inner = np.where(r2[..., None] < 0.81, values, np.where(r2[..., None] > 1.0, sky, np.nan))
        return np.asarray(inner * SKY)

    return Expected(seen_from_above(radiance, WIDTH, 32, 8), bound)


HALF = float(np.tan(np.radians(25.0)))
VIEW = View((0, 0, 1), (0, 1.2, 0), (0, 0, 1), (HALF, HALF), (32, 32))


def _plane(radiance: Albedo, bound: float = 1e-9, view: View = VIEW) -> Expected:
    """A plane seen at 15 to 65 degrees; radiance of the cosine, (..., 3) or times the sky."""

    def seen(x: FloatArray, y: FloatArray) -> FloatArray:
        values = np.asarray(radiance(np.abs(view.rays(x, y)[..., 2])))
        return values[..., None] * SKY if values.ndim == 2 else values

    return Expected(pixel_means(seen, 32, 32, 8), bound)


def _uniform(albedo: FloatArray) -> Expected:
    """A ball of one albedo: its disk, and the sky around it."""
    c, s = turn()
    film = np.stack([(c / WIDTH + 0.5) * 32, (0.5 - s / WIDTH) * 32], axis=1)
    return Expected(mix(coverage(film, 32, 32), albedo * SKY, SKY), 1e-9)


@case(r"$\rho L$", "a matte ball in a furnace")
def diffuse_furnace(rho: FloatArray = RHO) -> Expected:
    """A matte surface sends back its reflectance, in all directions."""
    return _uniform(rho)


@derivative("materials.matte.reflectance", diffuse_furnace, "rho", r"$L$ on the ball", spp=256)
def diffuse_furnace_by_reflectance() -> Expected:
    """All three reflectances move alike."""
    return Expected(_uniform(np.ones(3)).pixels - _uniform(np.zeros(3)).pixels, 1e-9)


@case(r"$\rho L$", "a mirror ball in a furnace")
def mirror_furnace() -> Expected:
    """A mirror shows the sky times its reflectance."""
    return _uniform(np.array([0.9, 0.6, 0.3]))


@case(r"$L$", "glass loses no light, whatever it bends and mirrors")
def glass_furnace() -> Expected:
    """Reflectance and transmittance are 1 together; radiance over the index squared is the same
    along a ray: a ball of glass cannot be seen."""
    return Expected(np.broadcast_to(SKY, (32, 32, 3)).copy())


@case(
    r"$F(\cos\theta) L$, $F$ of a complex index",
    "a metal's Fresnel reflectance",
    "Born & Wolf, 14.2",
)
def metal_furnace(eta: FloatArray = GOLD_ETA) -> Expected:
    """The mean of the reflectances of both polarisations."""
    pairs = [(eta[k], GOLD[k][1]) for k in range(3)]
    return _ball(lambda c: np.stack([fresnel_metal(c, *pair) for pair in pairs], axis=-1))


RATE = r"$\frac{r_s^2 + r_p^2}{2}$ by the index, $r_s$ and $r_p$ by the quotient rule"


@derivative("materials.gold.eta", metal_furnace, "eta", RATE)
def metal_furnace_by_eta() -> Expected:
    """The derivative of a square of a complex amplitude r is 2 Re(r* r')."""
    return _ball(
        lambda c: np.stack([fresnel_rate(c, complex(n, -k)) for n, k in GOLD], axis=-1), sky=0.0
    )


@case(r"$F(\cos\theta) L$", "the reflectance of glass at every angle", FRESNEL)
def glass_reflection() -> Expected:
    """The glass's transmittance is set to 0."""
    return _plane(lambda c: fresnel(c, 1.5))


@case(r"$(F + \frac{1 - F}{\eta^2}) L$", "radiance changes with the index squared", FRESNEL)
def glass_boundary(eta: float = 1.5) -> Expected:
    """One boundary, and the same radiance from both sides.  What comes out of glass fills eta^2
    times the solid angle that it had inside."""
    return _plane(lambda c: fresnel(c, eta) + (1.0 - fresnel(c, eta)) / eta**2)


@derivative(
    "materials.glass.interior_ior", glass_boundary, "eta",
    r"$(F' (1 - \frac{1}{\eta^2}) - \frac{2 (1 - F)}{\eta^3}) L$", spp=4096
)  # fmt: skip
def glass_boundary_by_index() -> Expected:
    """The product rule.  That radiance is spread over eta^2 outweighs the change of F."""

    def rate(c: FloatArray) -> FloatArray:
        spread = 2.0 * (1.0 - fresnel(c, 1.5)) / 1.5**3
        return np.asarray(fresnel_rate(c, 1.5) * (1.0 - 1.0 / 2.25) - spread)

    return _plane(rate)


@case(r"$(F + (1 - F) \eta^2) L$, $F = 1$ beyond the critical angle", "total reflection", FRESNEL)
def glass_from_inside() -> Expected:
    """As `glass_boundary`, seen from the glass: all that comes in is within the critical angle,
    41.8 degrees, and eta^2 as bright.  Pixels that it crosses are not stated."""
    critical = np.sqrt(1.0 - 1.0 / 2.25)

    def radiance(c: FloatArray) -> FloatArray:
        f = fresnel(c, 1.0 / 1.5)
        # The reflectance falls from 1 like a root.
        close = (c > critical - 0.03) & (c < critical + 0.06)
        return np.asarray(np.where(close, np.nan, f + (1.0 - f) * 2.25))

    view = View((0, 0, -1), (0, 1.0, 0), (0, 0, 1), (HALF, HALF), (32, 32))
    return _plane(radiance, 1e-8, view)


@case(r"$\frac{2 F}{1 + F} L$", "a thin pane's reflectance, all bounces within", "Stokes 1862")
def pane_reflection() -> Expected:
    """Light is mirrored by the front, or passes it and is mirrored by the back an odd number of
    times: F + (1 - F)^2 F / (1 - F^2)."""
    return _plane(lambda c: 2.0 * fresnel(c, 1.5) / (1.0 + fresnel(c, 1.5)))


@case(r"$\frac{1 - F}{1 + F} L$", "a thin pane's transmittance", "Stokes 1862")
def pane_transmission() -> Expected:
    """What `pane_reflection` leaves."""
    return _plane(lambda c: (1.0 - fresnel(c, 1.5)) / (1.0 + fresnel(c, 1.5)))


LAMP = np.array([3.0, 2.0, 1.0])


def _panes(count: int) -> Expected:
    """Sky and lamp through panes, by reflectance 2 N F / (1 + (2 N - 1) F)."""

    def radiance(c: FloatArray) -> FloatArray:
        f = fresnel(c, 1.5)
        r = (2 * count * f / (1.0 + (2 * count - 1) * f))[..., None]
        return np.asarray(r * SKY + (1.0 - r) * LAMP)

    return _plane(radiance)


@case(
    r"$(1 - R) L_{lamp} + R L$, $R = \frac{6 F}{1 + 5 F}$", "a stack of three panes", "Stokes 1862"
)
def stack_of_panes() -> Expected:
    """N panes mirror 2 N F / (1 + (2 N - 1) F): adding one to the stack sums a geometric series of
    bounces between it and the others."""
    return _panes(3)


@case(r"$(1 - R) L_{lamp} + R L$, $R = \frac{2 F}{1 + F}$", "a thick slab of glass: two boundaries")
def slab() -> Expected:
    """As `stack_of_panes` with one pane, which refracts: factors of the index cancel."""
    return _panes(1)


@case(r"$\sum_k \rho^k L_k$, of both sides in turn", "two mirrors that face each other")
def facing_mirrors() -> Expected:
    """Each mirror shines by itself, with a and b, and mirrors the other's image: a + rho b + rho^2
    a + ...  The path is cut after 12 edges."""
    a, b, rho = np.array([1.0, 0.5, 0.2]), np.array([0.1, 0.4, 1.0]), np.array([0.9, 0.7, 0.5])
    terms = [rho**k * (a, b)[k % 2] for k in range(12)], [rho**k * (b, a)[k % 2] for k in range(12)]
    # The mirrors meet at infinity, in the middle of the picture.
    pixels = np.empty((32, 32, 3))
    pixels[:, :16], pixels[:, 16:] = (np.sum(t, axis=0) for t in terms)
    # The mirrors end at 1e6 times their distance: 12 edges reach that far in 1e-3 of a column.
    return Expected(pixels, 1e-4)


@case(
    r"$\rho^3 L A$, $A$ the area of the triangle turned by 180 degrees",
    "three mirrors send light back",
)
def retro_reflector() -> Expected:
    """A ray that meets three mirrors at right angles leaves against its direction, on the other
    side of the axis through their corner: a triangle behind the camera is seen turned."""
    axis = np.ones(3) / np.sqrt(3.0)
    right = np.cross(-axis, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, -axis)
    corners = -np.array([[-0.5, -0.6], [0.7, -0.3], [0.1, 0.6]])
    film = np.stack([(corners[:, 0] / 2.0 + 0.5) * 32, (0.5 - corners[:, 1] / 2.0) * 32], axis=1)
    assert abs(right @ up) < 1e-15
    return Expected(mix(coverage(film, 32, 32), LAMP * np.array([0.9, 0.8, 0.7]) ** 3))


def _lit_ball(f: Callable[[FloatArray, FloatArray, int], FloatArray]) -> Expected:
    """A unit sphere under a directional light of irradiance 4 from (0.3, 0.5, 1): f times cosine
    of directions about the normal, by channel."""
    to = np.array([0.3, 0.5, 1.0]) / np.linalg.norm([0.3, 0.5, 1.0])

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        inside = x * x + y * y < 0.81
        z = np.sqrt(np.where(inside, 1.0 - x * x - y * y, 1.0))
        n = np.stack([np.where(inside, x, 0.0), np.where(inside, y, 0.0), z], axis=-1)
        # A frame about n, in which the view is in the plane of x and z.
        wo = np.stack([np.sqrt(1.0 - z * z), 0.0 * z, z], axis=-1)
        view = np.array([0.0, 0.0, 1.0])
        across = view - z[..., None] * n
        length = np.linalg.norm(across, axis=-1, keepdims=True)
        across = np.where(length > 1e-12, across / np.maximum(length, 1e-12), [1.0, 0.0, 0.0])
        other = np.cross(n, across)
        wi = np.stack([across @ to, other @ to, n @ to], axis=-1)
        values = np.stack([f(wi, wo, k) for k in range(3)], axis=-1)
        # At the terminator the light has a kink.
        return np.asarray(np.where((inside & (n @ to > 0.1))[..., None], values * 4.0, np.nan))

    return Expected(seen_from_above(radiance, 2.0, 32, 12), 1e-7)


MICROFACETS = "Walter et al. 2007"


@case(r"$\frac{D G F}{4 \cos\theta} E$", "a rough metal (GGX) in one light", MICROFACETS)
def ggx_in_light(alpha: float = 0.4) -> Expected:
    """D is GGX's distribution of normals, G Smith's masking of both directions, F Fresnel's
    reflectance at the half vector."""
    return _lit_ball(lambda wi, wo, k: rough_metal(wi, wo, alpha, *GOLD[k], name="ggx"))


@derivative(
    "materials.gold.alpha", ggx_in_light, "alpha",
    r"$f E (\frac{4 t^2}{\alpha^3 + \alpha t^2} - \frac{2}{\alpha} - "
    r"\sum_w \frac{\Lambda'}{1 + \Lambda})$, $t$ of the half vector",
)  # fmt: skip
def ggx_in_light_by_alpha() -> Expected:
    """By the logarithms of D and of the maskings 1 / (1 + Lambda), Lambda' = alpha t^2 / (2
    sqrt(1 + alpha^2 t^2)) with the direction's tangent t; F does not know the roughness."""
    a = 0.4

    def rate(wi: FloatArray, wo: FloatArray, k: int) -> FloatArray:
        hz = ((wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True))[..., 2]
        t2 = 1.0 / hz**2 - 1.0
        total = 4.0 * t2 / (a**3 + a * t2) - 2.0 / a
        for w in (wi, wo):
            tan2 = 1.0 / np.where(w[..., 2] > 0.0, w[..., 2], 1.0) ** 2 - 1.0
            root = np.sqrt(1.0 + a * a * tan2)
            total = total - a * tan2 / (2.0 * root) / ((1.0 + root) / 2.0)
        return np.asarray(total * rough_metal(wi, wo, a, *GOLD[k], name="ggx"))

    return _lit_ball(rate)


@case(r"$\frac{D G F}{4 \cos\theta} E$", "a rough metal (Beckmann) in one light", MICROFACETS)
def beckmann_in_light() -> Expected:
    """As `ggx_in_light`, with Beckmann's distribution and its exact masking."""
    return _lit_ball(lambda wi, wo, k: rough_metal(wi, wo, 0.4, *GOLD[k], name="beckmann"))


@case(r"$(k_d (n \cdot l) + k_s (r \cdot v)^p) E$", "the textbook's local shading", "Phong 1975")
def phong_in_light(exponent: float = 20.0) -> Expected:
    """The highlight's cosine is that of the light's direction and the mirrored view."""

    def shading(wi: FloatArray, wo: FloatArray, k: int) -> FloatArray:
        cosine, lit = _highlight(wi, wo), wi[..., 2] > 0.0
        return np.asarray(np.where(lit, RHO[k] / 4 * wi[..., 2] + 0.1 * cosine**exponent, 0.0))

    return _lit_ball(shading)


def _highlight(wi: FloatArray, wo: FloatArray) -> FloatArray:
    """The cosine between the light and the mirrored view, at least 0."""
    return np.asarray(np.maximum((wi * wo * [-1.0, -1.0, 1.0]).sum(axis=-1), 0.0))


@derivative(
    "materials.clay.exponent", phong_in_light, "exponent", r"$k_s (r \cdot v)^p \ln(r \cdot v) E$"
)
def phong_in_light_by_exponent() -> Expected:
    """A power by its exponent: 0 in the middle of the highlight, negative around it."""

    def rate(wi: FloatArray, wo: FloatArray, k: int) -> FloatArray:
        cosine = _highlight(wi, wo)
        safe = np.where(cosine > 0.0, cosine, 1.0)
        return np.asarray(np.where(wi[..., 2] > 0.0, 0.1 * safe**20 * np.log(safe), 0.0))

    return _lit_ball(rate)


@case(r"$(k_d (n \cdot l) + k_s (h \cdot n)^p) E$", "the form by the half vector", "Blinn 1977")
def blinn_in_light() -> Expected:
    """As `phong_in_light`: the highlight's cosine is that of the normal and the half vector."""

    def shading(wi: FloatArray, wo: FloatArray, k: int) -> FloatArray:
        h = wi + wo
        cosine = h[..., 2] / np.linalg.norm(h, axis=-1)
        lit = wi[..., 2] > 0.0
        return np.asarray(np.where(lit, RHO[k] / 4 * wi[..., 2] + 0.1 * cosine**40, 0.0))

    return _lit_ball(shading)


def _rough_ball(name: str) -> Expected:
    def albedo(c: FloatArray) -> FloatArray:
        by_channel = [
            half_vector_mean(c, 0.3, lambda m, p=pair: (fresnel_metal(m, *p), 0.0 * m), name)  # type: ignore[misc]
            for pair in GOLD
        ]
        return np.stack(by_channel, axis=-1)

    return _ball(albedo, 2e-5)


@case(
    r"$L \int \frac{D G F}{4 \cos\theta} d\omega$", "the albedo of a rough metal (GGX)", MICROFACETS
)
def ggx_furnace() -> Expected:
    """The integral over half vectors, on a grid of the distribution's own quantiles."""
    return _rough_ball("ggx")


@case(
    r"$L \int \frac{D G F}{4 \cos\theta} d\omega$",
    "the albedo of a rough metal (Beckmann)",
    MICROFACETS,
)
def beckmann_furnace() -> Expected:
    """As `ggx_furnace`."""
    return _rough_ball("beckmann")


@case(
    r"$L \int D G (F + \frac{1 - F}{\eta^2}) \frac{v \cdot m}{\cos\theta} dm$",
    "a rough boundary of glass",
    MICROFACETS,
)
def rough_boundary() -> Expected:
    """As `glass_boundary`, with the masking of the direction that a half vector refracts to."""

    def parts(m: FloatArray) -> tuple[FloatArray, FloatArray]:
        f = fresnel(m, 1.5)
        return f, (1.0 - f) / 2.25

    return _plane(lambda c: half_vector_mean(c, 0.3, parts, "ggx", 1.5), 2e-5)


def _inside(eta: float) -> float:
    """F_in: the mean of F over a matte light from within."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    c = (nodes + 1.0) / 2.0
    return 1.0 - (1.0 - float((fresnel(c, eta) * c) @ weights)) / eta**2


def _coat(eta: float, rho: FloatArray) -> Albedo:
    """F + (1 - F) rho (1 - F_in) / (1 - rho F_in)."""
    inside = _inside(eta)
    base = rho * (1.0 - inside) / (1.0 - rho * inside)

    def albedo(c: FloatArray) -> FloatArray:
        f = fresnel(c, eta)[..., None]
        return np.asarray(f + (1.0 - f) * base)

    return albedo


COAT = r"$(F + (1 - F) \frac{\rho (1 - F_{in})}{1 - \rho F_{in}}) L$"


@case(COAT, "a matte base under a clear coat", "Saunderson 1942")
def plastic_furnace(rho: FloatArray = RHO) -> Expected:
    """Light that passes the coat, 1 - F, is scattered by the base and mirrored back by the coat
    from within, F_in, again and again.  1 - F_in = (1 - F_out) / eta^2 ties the means of F."""
    return _ball(_coat(1.5, rho))


@derivative(
    "materials.coated.reflectance", plastic_furnace, "rho",
    r"$\frac{(1 - F) (1 - F_{in})}{(1 - \rho F_{in})^2} L$", spp=8192, step=1 / 64
)  # fmt: skip
def plastic_furnace_by_reflectance() -> Expected:
    """rho / (1 - rho F_in) by rho: each bounce below the coat brings the reflectance once more."""
    inside = _inside(1.5)
    base = (1.0 - inside) / (1.0 - RHO * inside) ** 2

    def rate(c: FloatArray) -> FloatArray:
        return np.asarray((1.0 - fresnel(c, 1.5))[..., None] * base)

    return _ball(rate, sky=0.0)


@case(COAT, "the same with an index of 2.4", "Saunderson 1942")
def plastic_dense_furnace() -> Expected:
    """As `plastic_furnace`: most light stays below the coat for long."""
    return _ball(_coat(2.4, RHO))


@case(r"$((1 - w) \rho + w r) L$", "a blend of a matte base and a mirror")
def blend_furnace() -> Expected:
    """A mixture of materials is linear in its weight, whatever it is sampled by."""
    return _uniform(0.7 * RHO + 0.3 * np.array([0.2, 0.6, 0.9]))


@case(r"$(o \rho + 1 - o) L$", "a mask that is open in part")
def mask_furnace() -> Expected:
    """A matte disk of opacity 0.4, in front of the sky, both sides alike."""
    return _uniform(0.4 * RHO + 0.6)


@case(r"$o \frac{\rho I \cos\theta}{\pi d^2}$, $o$ the opacity", "a mask in the light of a point")
def mask_in_light() -> Expected:
    """A matte floor of opacity 0.5: half of the light meets it, and is not counted twice."""
    place = level(2.0, 32)

    def radiance(x: FloatArray, y: FloatArray) -> FloatArray:
        u, v = place(x, y)
        return np.asarray(((u - 0.3) ** 2 + v**2 + 1.0)[..., None] ** -1.5 * RHO * 5.0 / np.pi)

    return Expected(0.5 * pixel_means(radiance, 32, 32))


@case(r"$\rho L$ of the front or the back", "the sides of a sheet")
def two_sides() -> Expected:
    """Of two squares, the right one shows its back."""
    pixels = np.empty((32, 32, 3))
    pixels[:, :16], pixels[:, 16:] = RHO * SKY, np.array([0.1, 0.3, 0.6]) * SKY
    return Expected(pixels)


@case(r"$(A + T \frac{\rho (1 - R_{out})}{1 - \rho R_{in}}) L$", "a rough clear coat", MICROFACETS)
def rough_plastic_furnace() -> Expected:
    """As `plastic_furnace` with a rough boundary: A is its albedo, T what it lets pass (of one
    microfacet each), (1 - R_out) the mean of T over a matte light from outside, over the index
    squared, R_in that of the albedo from within.  The means are Gauss's with 24 cosines."""
    alpha, eta = 0.3, 1.5
    nodes, weights = np.polynomial.legendre.leggauss(24)
    c, w = (nodes + 1.0) / 2.0, (nodes + 1.0) / 2.0 * weights

    def through(x: FloatArray, eta: float) -> FloatArray:
        return half_vector_mean(x, alpha, lambda m: (0.0 * m, 1.0 - fresnel(m, eta)), "ggx", eta)

    def mirrored(x: FloatArray, eta: float) -> FloatArray:
        return half_vector_mean(x, alpha, lambda m: (fresnel(m, eta), 0.0 * m), "ggx", eta)

    base = RHO * (through(c, eta) @ w / eta**2) / (1.0 - RHO * (mirrored(c, 1.0 / eta) @ w))

    def albedo(x: FloatArray) -> FloatArray:
        return np.asarray(mirrored(x, eta)[..., None] + through(x, eta)[..., None] * base)

    return _ball(albedo, 5e-5)
