"""Two causes together: something happens to positions, and then to colours.

What happens to positions is fitted while the reference has the candidate's colours, whatever
happened to these (`tints`).  Where that explains far more than other colours alone, each hypothesis
about colours is fitted to the reference at these positions.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from comparisons.compare.diagnosis import brightness, colour, tones
from comparisons.compare.diagnosis.contest import Contender, Fit, possible
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import NO_MATTER, Misfit
from comparisons.compare.diagnosis.place import Move, filters, moves, of_warp
from comparisons.compare.diagnosis.tints import Tint, by_distribution
from comparisons.compare.diagnosis.warps import Search

COLOURS: tuple[Fit, ...] = (*brightness.FITS, *colour.FITS, *tones.FITS)
"""Hypotheses about colours alone."""

JOINED = ", then "
"""Between the names of both."""

FAR_MORE = 0.5
"""What happens to positions must leave less than this fraction of what colours alone leave."""

TRIED = 4
"""So many families of moves are fitted again in better colours: those that leave least."""

AGAIN = 2
"""How often they are fitted again: the better the positions, the better the colours."""

MOST_MOVES = 2
"""So many families of moves are joined with colours."""

RIVAL = 10.0
"""Those leave at most this many times what the best one leaves."""


def pairs(misfit: Misfit) -> Iterator[tuple[Hypothesis, Misfit]]:
    """All of two causes that `chosen_pixels` leave possible, fitted, and the misfit that compares
    what each can know, beyond what colours alone explain."""
    misfit, likely = _likely_moves(misfit)
    small = misfit.sampled()
    first = list(possible([one for move in likely for one in _joined(move, misfit, small)]))
    yield from first
    again: list[Contender] = []
    for move in likely:
        of_move = [
            one
            for one in first
            if one[0].of is not None and one[0].family.startswith(f"{move.family}{JOINED}")
        ]
        if move.warp is None or not of_move:
            continue
        # Any colours may make up for positions that are a little off, a simple cause may not.
        simple, _ = min(
            of_move, key=lambda one: _more_likely((one[1].left(one[0].picture), one[0]))
        )
        search = Search(misfit, misfit.reference, simple.of)
        for warp in search.fitted(move.family, move.warp.amounts):
            if warp.order == move.warp.order:
                again += _joined(of_warp(warp, misfit.reference.shape), misfit, small)
    yield from possible(again)


def _joined(move: Move, misfit: Misfit, small: Misfit) -> list[Contender]:
    """The move, and then any of the colours."""

    def after(fit: Fit) -> Fit:
        return lambda seen: (both(one) for one in fit(seen))

    def both(one: Hypothesis) -> Hypothesis:
        return replace(
            one,
            family=f"{move.family}{JOINED}{one.family}",
            name=f"{move.name}{JOINED}{one.name}",
            evidence=f"{move.evidence}; then {one.evidence}",
            parameters=move.parameters + one.parameters,
            leaves=max(move.leaves, one.leaves),
            slack=move.slack(one.picture),
        )

    return list(move.then(map(after, COLOURS), misfit, small))


def _likely_moves(misfit: Misfit) -> tuple[Misfit, list[Move]]:
    """The misfit beyond what colours alone explain, and the moves that leave least in any
    colours."""
    r = misfit.reference
    small = misfit.sampled()
    wanted, weights = (x.reshape(-1, 3) for x in (small.candidate, small.weights))

    def tint(move: Move) -> Tint:
        return Tint(move.colours(misfit), wanted, weights)

    def improved(move: Move) -> Iterator[Move]:
        """Fitted again, now that its pixels show which colours became which."""
        yield move
        for _ in range(AGAIN):
            if move.family == "filter":
                move = next(filters(misfit, tint(move).of(r)))
                yield move
            elif move.warp is not None:
                search, order = Search(misfit, r, tint(move).of), move.warp.order
                for warp in search.fitted(move.family, move.warp.amounts):
                    if warp.order == order:
                        move = of_warp(warp, r.shape)
                        yield move

    def left(move: Move) -> float:
        seen = move.sampled(misfit, small)
        return seen.left(tint(move).of(seen.reference))

    still = Tint(small.reference.reshape(-1, 3), wanted, weights).of(r)
    misfit = misfit.beyond(still)
    if not (misfit.clear and misfit.excess > 0.0):
        return misfit, []
    small = misfit.sampled()
    bases = (still, by_distribution(misfit.candidate, r))
    tried = [(tint(move).squares, move) for base in bases for move in moves(misfit, base)]
    again = [one for _, move in _best_of_each(tried)[:TRIED] for one in improved(move)]
    likely = _best_of_each((left(move), move) for move in again)
    most = min(FAR_MORE, RIVAL * (max(likely[0][0], 0.0) + NO_MATTER))
    return misfit, [move for rest, move in likely[:MOST_MOVES] if rest < most]


def _best_of_each(found: Iterable[tuple[float, Move]]) -> list[tuple[float, Move]]:
    """Of moves and what they leave the best of each family, the best first."""
    best: dict[str, tuple[float, Move]] = {}
    for one in found:
        family = one[1].family
        best[family] = min(best.get(family, one), one, key=_more_likely)
    return sorted(best.values(), key=_more_likely)


def _more_likely(one: tuple[float, Move | Hypothesis]) -> float:
    """Increases with what a cause leaves, and by a tenth for each parameter that was fitted."""
    left, cause = one
    return (max(left, 0.0) + NO_MATTER) * 1.1**cause.parameters
