"""The rung `witness`: a third renderer's pictures turn a difference of two into one of three, and
say who stands alone; several of them are one rung."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from comparisons import statistics
from comparisons.renderers import NoCounterpartError, NoiseFree, WitnessName, other
from comparisons.results.case import RungResult, Status
from comparisons.rungs.noise_free import noise_free_witness
from reference_rt.core.arrays import FloatArray
from reference_rt.rendering.scene import Scene
from reference_rt.util.errors import ReferenceUnavailableError

PAIRS = ((0, 1), (0, 2), (1, 2))

Witness = Callable[
    [tuple[FloatArray, FloatArray], tuple[str, str]], tuple[RungResult, dict[str, FloatArray]]
]
"""Takes the replicates of both sides, or their pictures without noise, and whose they are; returns
the rung, and the witnesses' mean pictures by whose they are."""


def witnesses_of(
    names: Sequence[WitnessName],
    scene: Scene,
    limit: float,
    threads: int | None,
    say: Callable[[str], None],
    seen: Scene | None = None,
) -> Witness:
    """Several witnesses, see `witness_of`, as one.  Each is heard as if it were the only one."""
    some = scene, limit, threads, say, seen
    heard = {other(name).title: witness_of(name, *some) for name in names}

    def hear(
        replicates: tuple[FloatArray, FloatArray], sides: tuple[str, str]
    ) -> tuple[RungResult, dict[str, FloatArray]]:
        found = {title: witness(replicates, sides) for title, witness in heard.items()}
        shown = {whose: picture for _, some in found.values() for whose, picture in some.items()}
        return together({title: rung for title, (rung, _) in found.items()}), shown

    return hear


def together(rungs: Mapping[str, RungResult]) -> RungResult:
    """The rung of several witnesses by their titles: the gravest of theirs, so that none makes a
    verdict better than another leaves it.

    Witnesses disagree if one finds a difference, and another says that both sides are right, or
    that somebody else stands alone.  Right first hits are no answer to a wrong picture.
    """
    if len(rungs) == 1:
        return next(iter(rungs.values()))
    statuses = {rung.status for rung in rungs.values()}
    status = next(status for status in _GRAVEST if status in statuses)
    numbers: dict[str, Any] = {"witnesses": {title: r.numbers for title, r in rungs.items()}}
    reason = "; ".join(f"{title}: {rung.reason}" for title, rung in rungs.items())
    said = {title: text for title, rung in rungs.items() if (text := _said(rung))}
    blamed = {text for text in said.values() if text not in (_NOBODY, _SOMEBODY)}
    if len(blamed) > 1 or (_NOBODY in said.values() and len(set(said.values())) > 1):
        each = ", ".join(f"{title} says that {text}" for title, text in said.items())
        numbers["disagree"] = f"the witnesses disagree: {each}"
        reason = f"{numbers['disagree']}; {reason}"
    elif len({rung.numbers.get("alone") for rung in rungs.values()} - {None}) == 1:
        numbers["alone"] = next(r.numbers["alone"] for r in rungs.values() if "alone" in r.numbers)
    return RungResult("witness", status, reason, numbers)


_GRAVEST: tuple[Status, ...] = ("differ", "not-comparable", "agree", "not-applicable")

_NOBODY, _SOMEBODY = "both sides are right", "one side is wrong"


def _said(rung: RungResult) -> str:
    """What a witness says of the sides; "" if nothing, or of their first hits alone that they are
    right."""
    if alone := rung.numbers.get("alone"):
        both = alone == rung.numbers.get("whose")
        return "both sides are wrong, or it is itself" if both else f"{alone} stands alone"
    if rung.status == "differ":
        return _SOMEBODY
    is_of_pictures = "pairs" in rung.numbers or "picture" in rung.numbers
    return _NOBODY if rung.status == "agree" and is_of_pictures else ""


def witness_of(
    name: WitnessName,
    scene: Scene,
    limit: float,
    threads: int | None,
    say: Callable[[str], None],
    seen: Scene | None = None,
) -> Witness:
    """The witness of a scene's pictures.  limit: as in `statistics.compare`;  threads: its own,
    None for all cores;  seen: what we render, None for the same.  Raises
    ReferenceUnavailableError where it is not installed."""
    witness = other(name)
    if isinstance(witness, NoiseFree):
        return noise_free_witness(witness, scene, seen or scene, threads, say)
    version = witness.version()
    whose = witness.title + ("'" if witness.title.endswith("s") else "'s")

    def hear(
        replicates: tuple[FloatArray, FloatArray], sides: tuple[str, str]
    ) -> tuple[RungResult, dict[str, FloatArray]]:
        if min(map(len, replicates)) < 2:
            reason = f"{witness.title} has noise: it does not vote on pictures without"
            return RungResult("witness", "not-applicable", reason), {}
        count = max(2, *(len(side) for side in replicates))
        try:
            with witness.load(scene, threads) as loaded:
                rendered = loaded.render(count, scene.resolved_sampler.spp)
        except NoCounterpartError as error:
            reason = f"{error}: it does not vote"
            return RungResult("witness", "not-applicable", reason), {}
        except ReferenceUnavailableError as error:  # of this scene: others of a suite go on
            return RungResult("witness", "not-comparable", str(error)), {}
        say(f"witness: {count} pictures by {witness.title} ({rendered.seconds.sum():.1f} s)")
        rung = vote((*replicates, rendered.pictures), (*sides, whose), limit)
        rung.numbers.update(version=version, whose=whose)
        rung.numbers["seconds"] = float(np.median(rendered.seconds))
        return rung, {whose: rendered.pictures.mean(axis=0)}

    return hear


def vote(
    replicates: tuple[FloatArray, FloatArray, FloatArray],
    names: tuple[str, str, str],
    limit: float,
    of_sides: RungResult | None = None,
) -> RungResult:
    """Who of three renderers stands alone.  names: of the candidate, the reference, the witness;
    of_sides: the statistics of the former two, where they are judged otherwise, as by pairs.

    Each pair is judged as two renderers are, at a third of the level, so that the chance that any
    pair of right renderers differs is that of one comparison.  A renderer stands alone if it
    differs from both others, and these agree; or if their noise hides whether they do, but not a
    difference half as large as its own.
    """
    judged = {
        (a, b): statistics.compare(replicates[a], replicates[b], limit=limit, level=1.0 / 3.0)
        for a, b in PAIRS
        if of_sides is None or (a, b) != (0, 1)
    }
    if of_sides is not None:
        judged = {(0, 1): of_sides} | judged
    numbers = {
        "pairs": [
            {
                "sides": [names[a], names[b]],
                "status": judged[a, b].status,
                "bias": [float(x) for x in bias(replicates[a], replicates[b])],
            }
            for a, b in PAIRS
        ],
    }
    status_of = {pair: rung.status for pair, rung in judged.items()}
    alone = [k for k in range(3) if _stands_alone(k, status_of, replicates)]
    if alone:
        k, (a, b) = alone[0], [j for j in range(3) if j != alone[0]]
        by = " and ".join(_bias_text(replicates[k], replicates[j]) for j in (a, b))
        reason = (
            f"{names[k]} differs from {names[a]} and {names[b]} by {by} of the image mean, and "
            f"these two by {_bias_text(replicates[a], replicates[b])}: {names[k]} stands alone"
        )
        # Two that agree with each other and not with the witness may share a fault: nobody is
        # acquitted.  Where the reference stands alone, the witness confirms the candidate.
        status: Status = "agree" if k == 1 else "differ"
        return RungResult("witness", status, reason, numbers | {"alone": names[k]})
    statuses = {r.status for r in judged.values()}
    if statuses == {"agree"}:
        by = _bias_text(replicates[0], replicates[2])
        found_by = f"{names[0]} differs from it by {by} of the image mean"
        reason = f"{names[2]} agrees with both: {found_by}"
        return RungResult("witness", "agree", reason, numbers)
    told = "; ".join(f"{names[a]} and {names[b]}: {judged[a, b].status}" for a, b in PAIRS)
    return RungResult("witness", "not-applicable", f"no vote ({told})", numbers)


SURE = 3.5
"""Standard errors: a bias is beyond as many in 0.05 % of comparisons."""


def _stands_alone(
    k: int, status: dict[tuple[int, int], Status], replicates: tuple[FloatArray, ...]
) -> bool:
    (others,) = (pair for pair in PAIRS if k not in pair)
    own = [pair for pair in PAIRS if k in pair]
    if any(status[pair] != "differ" for pair in own):
        return False
    if status[others] != "inconclusive":
        return status[others] == "agree"
    mean, error = bias(*(replicates[j] for j in others))
    least = min(abs(bias(*(replicates[j] for j in pair))[0]) for pair in own)
    return abs(mean) + SURE * error < least / 2.0


def bias(a: FloatArray, b: FloatArray) -> tuple[float, float]:
    """The relative difference of the image means of a and b, and its standard error."""
    means = [x.mean(axis=(1, 2, 3)) for x in (a, b)]
    middle = means[1].mean()
    if middle == 0.0:
        return 0.0, 0.0
    error = np.sqrt(sum(m.var(ddof=1) / len(m) for m in means if len(m) > 1))
    return float(means[0].mean() / middle - 1.0), float(error / abs(middle))


def _bias_text(a: FloatArray, b: FloatArray) -> str:
    mean, error = (100.0 * x for x in bias(a, b))
    return f"{mean:+.2g} ± {error:.1g} %"
