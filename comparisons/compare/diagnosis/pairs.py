"""Two causes together: something happens to positions, and then to colours.

What happens to positions is fitted while the reference has the candidate's colours, whatever
happened to these (`tints`).  Where that explains far more than other colours alone, each hypothesis
about colours is fitted to the reference at these positions.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from comparisons.compare.diagnosis import brightness, colour, tones
from comparisons.compare.diagnosis.hypothesis import Hypothesis
from comparisons.compare.diagnosis.misfit import NO_MATTER, Misfit
from comparisons.compare.diagnosis.place import Move, filters, moves, of_warp
from comparisons.compare.diagnosis.tints import Tint, by_distribution
from comparisons.compare.diagnosis.warps import Search, chosen_pixels

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


def of_colours(misfit: Misfit) -> Iterator[Hypothesis]:
    """Hypotheses about colours alone."""
    yield from brightness.hypotheses(misfit, {})
    yield from colour.hypotheses(misfit)
    yield from tones.hypotheses(misfit)


def pairs(misfit: Misfit) -> Iterator[tuple[Hypothesis, Misfit]]:
    """All of two causes, fitted, and the misfit that compares what each can know, beyond what
    colours alone explain."""
    likely, misfit = _likely_moves(misfit)
    for move in likely:
        seen = move.seen(misfit)
        first = [_joined(move, one, seen) for one in of_colours(seen)]
        yield from first
        simple, _ = min(first, key=lambda one: _more_likely((seen.left(one[0].picture), one[0])))
        if move.warp is None or simple.of is None:
            continue
        # Any colours may make up for positions that are a little off, a simple cause may not.
        search = Search(misfit, misfit.reference, simple.of)
        for warp in search.fitted(move.family, move.warp.amounts):
            if warp.order != move.warp.order:
                continue
            again = of_warp(warp, misfit.reference.shape)
            seen = again.seen(misfit)
            yield from (_joined(again, one, seen) for one in of_colours(seen))


def _joined(move: Move, one: Hypothesis, seen: Misfit) -> tuple[Hypothesis, Misfit]:
    both = replace(
        one,
        family=f"{move.family}{JOINED}{one.family}",
        name=f"{move.name}{JOINED}{one.name}",
        evidence=f"{move.evidence}; then {one.evidence}",
        parameters=move.parameters + one.parameters,
        leaves=max(move.leaves, one.leaves),
        slack=move.slack(one.picture),
    )
    return both, seen


def _likely_moves(misfit: Misfit) -> tuple[list[Move], Misfit]:
    """Those that leave least in any colours, and the misfit beyond what colours alone explain."""
    r = misfit.reference
    pixels = chosen_pixels(r.shape)
    wanted, weights = (x.reshape(-1, 3)[pixels] for x in (misfit.candidate, misfit.weights))

    def tint(move: Move) -> Tint:
        return Tint(move.at(r, pixels), wanted, weights)

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
        seen = move.seen(misfit)
        return seen.left(tint(move).of(seen.reference))

    still = Tint(r.reshape(-1, 3)[pixels], wanted, weights).of(r)
    misfit = misfit.beyond(still)
    if not (misfit.clear and misfit.excess > 0.0):
        return [], misfit
    bases = (still, by_distribution(misfit.candidate, r))
    tried = [(tint(move).squares, move) for base in bases for move in moves(misfit, base)]
    again = [one for _, move in _best_of_each(tried)[:TRIED] for one in improved(move)]
    likely = _best_of_each((left(move), move) for move in again)
    most = min(FAR_MORE, RIVAL * (max(likely[0][0], 0.0) + NO_MATTER))
    return [move for rest, move in likely[:MOST_MOVES] if rest < most], misfit


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
