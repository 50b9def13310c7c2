"""Which methods no other beats: the Pareto front of cost against merit."""

from collections.abc import Sequence


def pareto_front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of (cost, merit) that no other point has at no more cost and no less merit, one of the two strictly; in
    the order of cost. Of equal points all count."""

    def beaten(point: tuple[float, float]) -> bool:
        return any(x <= point[0] and y >= point[1] and (x, y) != tuple(point) for x, y in points)

    return sorted((i for i, point in enumerate(points) if not beaten(point)), key=lambda i: points[i])
