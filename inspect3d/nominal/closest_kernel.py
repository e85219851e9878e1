"""Closest points of triangles: numba kernels over plain arrays.

A triangle has seven features a foot can lie on: 0 the face, 1 to 3 the edges ab, bc, ca, and 4 to 6 the vertices
a, b, c. A slot is the place of a triangle in the packets: 8 times the packet plus the lane.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.nominal.bvh import BRANCH, LANES, STACK
from inspect3d.nominal.gather_kernel import gathered_normal

BATCH = 512


@njit(cache=True, parallel=True)
def closest(points, visit, tree, features, feet, distance, normals, triangle, on_rim):
    """Write the feet of points[visit]; neighbours in `visit` should be neighbours in space.

    Parameters
    ----------
    points : (n, 3) mm, from the origin of the tree
    visit : (k,) which points, in which order
    tree : the arrays of `Tree`
    features : the arrays of `Features`
    feet, distance, normals, triangle, on_rim : (n, ...), written
    """
    for batch in prange((len(visit) + BATCH - 1) // BATCH):
        turn = visit[batch * BATCH : (batch + 1) * BATCH]
        _closest_in_turn(points, turn, tree, features, feet, distance, normals, triangle, on_rim)


@njit(cache=True)
def _closest_in_turn(points, visit, tree, features, feet, distance, normals, triangle, on_rim):
    stack, bounds, squares = np.empty(STACK, dtype=np.int64), np.empty(STACK), np.empty(LANES)
    slot = 0
    for i in visit:
        x, y, z = points[i, 0] - tree.origin[0], points[i, 1] - tree.origin[1], points[i, 2] - tree.origin[2]
        slot = _nearest(x, y, z, tree, slot // LANES, stack, bounds, squares)
        packet, lane = slot // LANES, slot % LANES
        feature, vx, vy, vz = _foot(x, y, z, tree.packets[packet], lane)
        length = math.sqrt(vx * vx + vy * vy + vz * vz)

        triangle[i] = tree.members[packet, lane]
        which = features.of_triangle[triangle[i], feature]
        nx, ny, nz = features.normals[which, 0], features.normals[which, 1], features.normals[which, 2]
        on_rim[i] = features.rims[which]
        if nx == 0 and ny == 0 and nz == 0:
            nx, ny, nz, on_rim[i] = gathered_normal(x - vx, y - vy, z - vz, tree, features)
        if nx == 0 and ny == 0 and nz == 0:
            nx, ny, nz = (vx / length, vy / length, vz / length) if length > 0 else (0.0, 0.0, 1.0)

        distance[i] = -length if nx * vx + ny * vy + nz * vz < 0 else length
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        feet[i, 0], feet[i, 1], feet[i, 2] = points[i, 0] - vx, points[i, 1] - vy, points[i, 2] - vz


@njit(cache=True)
def _nearest(x, y, z, tree, start, stack, bounds, squares):
    """Return the slot of the triangle nearest to a point; of several equally near the one of the lowest number.

    The packet `start`, best that of a point nearby, is looked at first and bounds the walk.
    """
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
def _better(squares, members, packet, slot, least):
    for lane in range(LANES):
        if squares[lane] <= least:
            lower = members[packet, lane] < members[slot // LANES, slot % LANES]
            if squares[lane] < least or lower:
                slot, least = LANES * packet + lane, squares[lane]
    return slot, least


@njit(cache=True)
def _box_square(x, y, z, boxes, node):
    """Return the squared distance from a point to a box."""
    dx = max(boxes[node, 0] - x, x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - y, y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - z, z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def _write_squares(x, y, z, packet, lanes, squares):
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


@njit(cache=True)
def _foot(x, y, z, packet, lane):
    """Return the feature a foot lies on, and the vector from there to the point; the rule of `_write_squares`."""
    nx, ny, nz = packet[9, lane], packet[10, lane], packet[11, lane]
    height = nx * (x - packet[0, lane]) + ny * (y - packet[1, lane]) + nz * (z - packet[2, lane])
    feature, vx, vy, vz = 0, height * nx, height * ny, height * nz
    least = np.inf
    for k in range(3):
        i, j = 3 * k, 3 * ((k + 1) % 3)
        px, py, pz = x - packet[i, lane], y - packet[i + 1, lane], z - packet[i + 2, lane]
        qx, qy, qz = x - packet[j, lane], y - packet[j + 1, lane], z - packet[j + 2, lane]
        ex = packet[j, lane] - packet[i, lane]
        ey = packet[j + 1, lane] - packet[i + 1, lane]
        ez = packet[j + 2, lane] - packet[i + 2, lane]
        if nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px) > 0:
            continue
        along, whole = ex * px + ey * py + ez * pz, ex * ex + ey * ey + ez * ez
        candidate = 1 + k
        if along <= 0:
            candidate = 4 + k
        elif along >= whole:
            candidate = 4 + (k + 1) % 3
            px, py, pz = qx, qy, qz
        else:
            s = along / whole
            px, py, pz = px - s * ex, py - s * ey, pz - s * ez
        square = px * px + py * py + pz * pz
        if square < least:
            least, feature, vx, vy, vz = square, candidate, px, py, pz
    return feature, vx, vy, vz
