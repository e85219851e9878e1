"""Which triangle is nearest to a point: numba kernels over the arrays of a `Tree`.

A slot is the place of a triangle in the packets: 8 times the packet plus the lane.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from inspect3d.arrays import Floats, Integers
from inspect3d.nominal.bvh import BRANCH, LANES, STACK, Tree


@njit(cache=True)
def write_nearest(points: Floats, tree: Tree, slots: Integers) -> None:
    """Write the slots (n,) of the triangles nearest to points (n, 3) mm, counted from the origin of the tree.

    Of several triangles equally near it is the one of the lowest number. Points that follow each other should be near
    each other: each walk through the tree is bounded by the packet where the one before it ended.
    """
    stack, bounds, squares = np.empty(STACK, dtype=np.int64), np.empty(STACK), np.empty(LANES)
    slot = 0
    for k in range(len(points)):
        x, y, z = points[k]
        slot = _nearest(x, y, z, tree, slot // LANES, stack, bounds, squares)
        slots[k] = slot


@njit(cache=True)
def _nearest(
    x: float, y: float, z: float, tree: Tree, start: int, stack: Integers, bounds: Floats, squares: Floats
) -> int:
    """Return the slot of the triangle nearest to a point, looking at the packet `start` first."""
    boxes, links = tree.boxes, tree.links
    _write_squares(x, y, z, tree.packets[start], tree.packets.shape[2], squares)
    slot, least = _better(squares, tree.members, start, LANES * start, squares[0])
    stack[0], bounds[0] = 0, 0.0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        if bounds[waiting] > least:
            continue
        node = stack[waiting]
        while links[node, 0] == BRANCH:
            near, far = links[node, 1], links[node, 1] + 1
            near_bound, far_bound = _box_square(x, y, z, boxes, near), _box_square(x, y, z, boxes, far)
            if far_bound < near_bound:
                near, far, near_bound, far_bound = far, near, far_bound, near_bound
            if near_bound > least:
                break
            if far_bound <= least:
                stack[waiting], bounds[waiting] = far, far_bound
                waiting += 1
            node = near
        else:
            packet = links[node, 1]
            if packet != start:
                _write_squares(x, y, z, tree.packets[packet], tree.packets.shape[2], squares)
                slot, least = _better(squares, tree.members, packet, slot, least)
    return slot


@njit(cache=True)
def _better(squares: Floats, members: Integers, packet: int, slot: int, least: float) -> tuple[int, float]:
    """Return the slot and squared distance of the best so far or a better one of a packet."""
    for lane in range(LANES):
        if squares[lane] <= least:
            lower = members[packet, lane] < members[slot // LANES, slot % LANES]
            if squares[lane] < least or lower:
                slot, least = LANES * packet + lane, squares[lane]
    return slot, least


@njit(cache=True)
def _box_square(x: float, y: float, z: float, boxes: Floats, node: int) -> float:
    """Return the squared distance from a point to a box."""
    dx = max(boxes[node, 0] - x, x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - y, y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - z, z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _write_squares(x: float, y: float, z: float, packet: Floats, lanes: int, squares: Floats) -> None:
    """Write the squared distances from a point to the triangles of a packet, all lanes at once.

    It is the plane's where the point lies strictly within all three edges seen along the normal, else the least of the
    edges'. That is exact to rounding for needles, where barycentric coordinates are not, and a triangle without area,
    whose normal is zero, is its edges. (A number of lanes the compiler does not know lets it use vector instructions.)
    """
    for k in range(lanes):
        nx, ny, nz = packet[9, k], packet[10, k], packet[11, k]
        ax, ay, az = x - packet[0, k], y - packet[1, k], z - packet[2, k]
        bx, by, bz = x - packet[3, k], y - packet[4, k], z - packet[5, k]
        cx, cy, cz = x - packet[6, k], y - packet[7, k], z - packet[8, k]
        ux, uy, uz = packet[3, k] - packet[0, k], packet[4, k] - packet[1, k], packet[5, k] - packet[2, k]
        vx, vy, vz = packet[6, k] - packet[3, k], packet[7, k] - packet[4, k], packet[8, k] - packet[5, k]
        wx, wy, wz = packet[0, k] - packet[6, k], packet[1, k] - packet[7, k], packet[2, k] - packet[8, k]
        height = nx * ax + ny * ay + nz * az
        within_ab = nx * (uy * az - uz * ay) + ny * (uz * ax - ux * az) + nz * (ux * ay - uy * ax)
        within_bc = nx * (vy * bz - vz * by) + ny * (vz * bx - vx * bz) + nz * (vx * by - vy * bx)
        within_ca = nx * (wy * cz - wz * cy) + ny * (wz * cx - wx * cz) + nz * (wx * cy - wy * cx)
        s = min(max((ux * ax + uy * ay + uz * az) * packet[12, k], 0.0), 1.0)
        ax, ay, az = ax - s * ux, ay - s * uy, az - s * uz
        s = min(max((vx * bx + vy * by + vz * bz) * packet[13, k], 0.0), 1.0)
        bx, by, bz = bx - s * vx, by - s * vy, bz - s * vz
        s = min(max((wx * cx + wy * cy + wz * cz) * packet[14, k], 0.0), 1.0)
        cx, cy, cz = cx - s * wx, cy - s * wy, cz - s * wz
        edges = min(ax * ax + ay * ay + az * az, min(bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz))
        inside = (within_ab > 0) & (within_bc > 0) & (within_ca > 0)
        squares[k] = height * height if inside else edges
