"""Is a material of your own right?  Rough metal in NumPy, and three mistakes in it.

    python examples/own_material.py

No renderer and no scene is needed: functions of arrays are enough (docs/python.md).
"""

import math

import numpy as np

from comparisons import testing

ALPHA, COLOUR = 0.4, np.array([1.0, 0.8, 0.4])


def half_of(wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """Between two directions: the normal of the facet that reflects one into the other."""
    h = wo + wi
    return h / np.maximum(np.linalg.norm(h, axis=1), 1e-30)[:, None]


def normals(h: np.ndarray) -> np.ndarray:
    """GGX: the density of facets' normals, over projected area."""
    return ALPHA**2 / (math.pi * ((h[:, 2] ** 2) * (ALPHA**2 - 1.0) + 1.0) ** 2)


def smith(v: np.ndarray) -> np.ndarray:
    """The part of the facets that is seen from v."""
    tan2 = (1.0 - v[:, 2] ** 2) / v[:, 2] ** 2
    return 2.0 / (1.0 + np.sqrt(1.0 + ALPHA**2 * tan2))


def pdf(wo: np.ndarray, wi: np.ndarray, mistake: str = "") -> np.ndarray:
    """Of facets in proportion to D cos, and of what they reflect: 1 / (4 wo . h)."""
    h = half_of(wo, wi)
    jacobian = 1.0 if mistake == "no Jacobian" else 4.0 * np.maximum((wo * h).sum(axis=1), 1e-30)
    return np.where((wo[:, 2] > 0) & (wi[:, 2] > 0), normals(h) * h[:, 2] / jacobian, 0.0)


def evaluate(wo: np.ndarray, wi: np.ndarray, mistake: str = "") -> np.ndarray:
    """f |cos wi| = D G / (4 cos wo), times the colour."""
    masked = smith(wo) * (1.0 if mistake == "one side's shadows" else smith(wi))
    value = normals(half_of(wo, wi)) * masked / (4.0 * np.maximum(wo[:, 2], 1e-30))
    return np.where((wo[:, 2] > 0) & (wi[:, 2] > 0), value, 0.0)[:, None] * COLOUR


def sample(wo: np.ndarray, u: np.ndarray, mistake: str = "") -> tuple[np.ndarray, np.ndarray]:
    """A facet, what it reflects, and value / pdf; what goes below the surface has failed."""
    cosine = np.sqrt((1.0 - u[:, 0]) / (1.0 + (ALPHA**2 - 1.0) * u[:, 0]))
    sine, turn = np.sqrt(1.0 - cosine**2), 2.0 * math.pi * u[:, 1]
    h = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=1)
    wi = 2.0 * (wo * h).sum(axis=1)[:, None] * h - wo
    lost = wi[:, 2] <= 0.0
    wi[lost] = (0.0, 0.0, 1.0)
    weight = evaluate(wo, wi) / np.maximum(pdf(wo, wi), 1e-30)[:, None]
    if mistake == "failed draws count":
        return wi, weight
    return np.where(lost[:, None], np.nan, wi), np.where(lost[:, None], 0.0, weight)


for mistake in ("", "no Jacobian", "one side's shadows", "failed draws count"):
    print(f"{mistake or 'as it should be'}:")
    for found in testing.check_material(
        lambda wo, wi, m=mistake: evaluate(wo, wi, m),
        lambda wo, u, m=mistake: sample(wo, u, m),
        lambda wo, wi, m=mistake: pdf(wo, wi, m),
    ):
        print(f"  {found.name}: {'passed' if found else 'FAILED'}: {found.reason}")
