"""A sum of decision trees: log odds from a row of numbers, read from plain lists."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from loop.signals import Real

Places = NDArray[np.intp]
LEAF = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoostedTrees:
    """Trees in one row of nodes, each node before its left and then its right branch.

    Attributes
    ----------
    roots : ndarray of int, shape (t,)
        Places of the trees' first nodes.
    number : ndarray of int, shape (m,)
        Which number a node looks at, -1 in a leaf.
    edge : ndarray of int, shape (m,)
        Number of the edge up to which the left branch is taken; the left branch is the next node.
    right : ndarray of int, shape (m,)
        Place of the right branch.
    value : ndarray, shape (m,)
        What a leaf adds to the log odds. [-]
    edges : tuple of ndarray, length k
        Edges of every number, increasing.
    depth : int
        Splits on the longest way through a tree.
    """

    roots: Places
    number: Places
    edge: Places
    right: Places
    value: Real
    edges: tuple[Real, ...]
    depth: int

    def log_odds(self, rows: Real) -> Real:
        """Sum of the leaves that each row ends in, shape (n, k) -> (n,)."""
        bins = np.stack(
            [np.searchsorted(edges, rows[:, j]) for j, edges in enumerate(self.edges)], axis=1
        )
        at = np.tile(self.roots, (rows.shape[0], 1))
        row = np.arange(rows.shape[0])[:, None]
        for _ in range(self.depth):
            number = self.number[at]
            left = bins[row, number] <= self.edge[at]
            at = np.where(number == LEAF, at, np.where(left, at + 1, self.right[at]))
        return np.asarray(self.value[at].sum(axis=1))


def trees_from(body: Mapping[str, Any]) -> BoostedTrees:
    """Read trees from the lists that `benchmarks/answer_weights.py` writes.

    Parameters
    ----------
    body : mapping
        `number` of every node, -1 in a leaf; `edge` and `right`, the distance to the right
        branch, of the splits, and `value` of the leaves, in the order of the nodes; `edges` of
        every number.
    """
    number = np.array(body["number"], dtype=np.intp)
    leaf = number == LEAF
    edge, right, value = np.zeros_like(number), np.arange(number.size), np.zeros(number.size)
    edge[~leaf] = body["edge"]
    right[~leaf] += np.array(body["right"], dtype=np.intp)
    value[leaf] = body["value"]
    # A tree ends where its open branches do: a split opens one more, a leaf closes one.
    depths: list[int] = []
    roots: list[int] = []
    waiting: list[int] = []
    for place, ends in enumerate(leaf.tolist()):
        if not waiting:
            roots.append(place)
            waiting = [0]
        depth = waiting.pop()
        depths.append(depth)
        if not ends:
            waiting += [depth + 1, depth + 1]
    if waiting:
        raise ValueError("the last tree is cut off: fit the weights again")
    return BoostedTrees(
        roots=np.array(roots, dtype=np.intp), number=number, edge=edge, right=right, value=value,
        edges=tuple(np.array(row, dtype=np.float64) for row in body["edges"]),
        depth=max(depths, default=0),
    )  # fmt: skip
