"""Closest points on triangles, and the feature (face, edge, vertex) they lie on: numba kernels over plain arrays.

A facet is a row of 12 numbers: corners a, b, c and the unit normal n (zero where the triangle has no area). Features
are numbered 0 the face, 1 to 3 the edges ab, bc, ca, and 4 to 6 the vertices a, b, c.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from inspect3d.nominal.bvh import STACK

BATCH = 512


@njit(cache=True, parallel=True)
def closest(
    points,
    visit,
    centre,
    boxes,
    links,
    order,
    facets,
    edges,
    edge_normals,
    edge_rim,
    corners,
    corner_normals,
    corner_rim,
    tolerance,
    feet,
    distance,
    normals,
    triangle,
    on_rim,
):
    """Write the feet of points[visit]; neighbours in `visit` should be neighbours in space.

    Parameters
    ----------
    points : (n, 3) mm
    visit : (k,) which points, in which order
    centre : (3,) mm, origin of the facets and boxes
    boxes, links, order : the tree
    facets : (m, 12) in the order of the tree's leaves
    edges, corners : (m, 3) numbers of the edges ab, bc, ca (-1: none) and of the vertices a, b, c, by triangle
    edge_normals, corner_normals : pseudo-normals, unit; zero where they must be gathered at the foot
    edge_rim, corner_rim : whether an edge or vertex lies on an open rim
    tolerance : mm, triangles closer to a foot than this touch it where normals are gathered
    feet, distance, normals, triangle, on_rim : written
    """
    for batch in prange((len(visit) + BATCH - 1) // BATCH):
        _closest_of_batch(
            points,
            visit[batch * BATCH : (batch + 1) * BATCH],
            centre,
            boxes,
            links,
            order,
            facets,
            edges,
            edge_normals,
            edge_rim,
            corners,
            corner_normals,
            corner_rim,
            tolerance,
            feet,
            distance,
            normals,
            triangle,
            on_rim,
        )


@njit(cache=True)
def _closest_of_batch(
    points,
    visit,
    centre,
    boxes,
    links,
    order,
    facets,
    edges,
    edge_normals,
    edge_rim,
    corners,
    corner_normals,
    corner_rim,
    tolerance,
    feet,
    distance,
    normals,
    triangle,
    on_rim,
):
    stack = np.empty(STACK, dtype=np.int64)
    bound = np.empty(STACK)
    normal = np.empty(3)
    slot = 0
    for i in visit:
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        slot = _nearest_facet(x, y, z, boxes, links, order, facets, slot, stack, bound)
        _, feature, vx, vy, vz = project(x, y, z, facets, slot, np.inf)
        k = order[slot]
        rim = False
        normal[:] = 0.0
        if feature == 0:
            normal[:] = facets[slot, 9:]
        elif feature <= 3:
            edge = edges[k, feature - 1]
            if edge >= 0:
                normal[:] = edge_normals[edge]
                rim = edge_rim[edge]
        else:
            corner = corners[k, feature - 4]
            normal[:] = corner_normals[corner]
            rim = corner_rim[corner]
        if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
            rim = _gather(
                x - vx, y - vy, z - vz, boxes, links, order, facets, edges, edge_rim, tolerance, stack, normal
            )
        length = math.sqrt(vx * vx + vy * vy + vz * vz)
        if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
            if length > 0:
                normal[0], normal[1], normal[2] = vx / length, vy / length, vz / length
            else:
                normal[2] = 1.0
        inside = normal[0] * vx + normal[1] * vy + normal[2] * vz < 0
        distance[i] = -length if inside else length
        feet[i, 0], feet[i, 1], feet[i, 2] = points[i, 0] - vx, points[i, 1] - vy, points[i, 2] - vz
        normals[i, 0], normals[i, 1], normals[i, 2] = normal[0], normal[1], normal[2]
        triangle[i] = k
        on_rim[i] = rim


@njit(cache=True)
def _nearest_facet(x, y, z, boxes, links, order, facets, start, stack, bound):
    """Return the facet nearest to a point; of several equally near the one of the lowest triangle number."""
    best = start
    least = project(x, y, z, facets, start, np.inf)[0]
    stack[0], bound[0] = 0, 0.0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        if bound[waiting] > least:
            continue
        node = stack[waiting]
        while links[node, 1] == 0:
            near = links[node, 0]
            far = near + 1
            near_bound, far_bound = _to_box(x, y, z, boxes, near), _to_box(x, y, z, boxes, far)
            if far_bound < near_bound:
                near, far, near_bound, far_bound = far, near, far_bound, near_bound
            if near_bound > least:
                break
            if far_bound <= least:
                stack[waiting], bound[waiting] = far, far_bound
                waiting += 1
            node = near
        else:
            first = links[node, 0]
            for slot in range(first, first + links[node, 1]):
                squared = project(x, y, z, facets, slot, least)[0]
                if squared < least or (squared == least and order[slot] < order[best]):
                    best, least = slot, squared
    return best


@njit(cache=True)
def _to_box(x, y, z, boxes, node):
    """Return the squared distance from a point to a box."""
    dx = max(boxes[node, 0] - x, x - boxes[node, 3], 0.0)
    dy = max(boxes[node, 1] - y, y - boxes[node, 4], 0.0)
    dz = max(boxes[node, 2] - z, z - boxes[node, 5], 0.0)
    return dx * dx + dy * dy + dz * dz


@njit(cache=True)
def project(x, y, z, facets, slot, limit):
    """Return squared distance, feature, and the vector to a point from its foot on a facet.

    The foot is in the face where the point lies strictly within all three edges seen along n; otherwise on the nearest
    of the edges it does not lie within. That stays exact to rounding for needles, where barycentric coordinates do not,
    and never calls a point of a triangle without area a point of its face. The work ends early, with infinity, where the
    plane is farther than the squared distance `limit`.
    """
    nx, ny, nz = facets[slot, 9], facets[slot, 10], facets[slot, 11]
    ax, ay, az = x - facets[slot, 0], y - facets[slot, 1], z - facets[slot, 2]
    height = nx * ax + ny * ay + nz * az
    if height * height > limit:
        return np.inf, 0, 0.0, 0.0, 0.0
    least, feature, vx, vy, vz = np.inf, 0, 0.0, 0.0, 0.0
    for k in range(3):
        i, j = 3 * k, 3 * ((k + 1) % 3)
        px, py, pz = x - facets[slot, i], y - facets[slot, i + 1], z - facets[slot, i + 2]
        ex, ey, ez = (
            facets[slot, j] - facets[slot, i],
            facets[slot, j + 1] - facets[slot, i + 1],
            facets[slot, j + 2] - facets[slot, i + 2],
        )
        if nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px) > 0:
            continue
        along, whole = ex * px + ey * py + ez * pz, ex * ex + ey * ey + ez * ez
        candidate = 1 + k
        if along <= 0:
            candidate = 4 + k
        elif along >= whole:
            candidate = 4 + (k + 1) % 3
            px, py, pz = x - facets[slot, j], y - facets[slot, j + 1], z - facets[slot, j + 2]
        else:
            t = along / whole
            px, py, pz = px - t * ex, py - t * ey, pz - t * ez
        squared = px * px + py * py + pz * pz
        if squared < least:
            least, feature, vx, vy, vz = squared, candidate, px, py, pz
    if least == np.inf:
        return height * height, 0, height * nx, height * ny, height * nz
    return least, feature, vx, vy, vz


@njit(cache=True)
def _gather(x, y, z, boxes, links, order, facets, edges, edge_rim, tolerance, stack, normal):
    """Write the angle-weighted normal of all facets that touch a point; return whether it lies on an open rim."""
    rim = False
    near = np.empty(3, dtype=np.bool_)
    stack[0] = 0
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if _to_box(x, y, z, boxes, node) > tolerance**2:
            continue
        if links[node, 1] == 0:
            stack[waiting], stack[waiting + 1] = links[node, 0], links[node, 0] + 1
            waiting += 2
            continue
        for slot in range(links[node, 0], links[node, 0] + links[node, 1]):
            if project(x, y, z, facets, slot, np.inf)[0] > tolerance**2:
                continue
            for k in range(3):
                near[k] = (
                    _to_segment(
                        x,
                        y,
                        z,
                        facets[slot, 3 * k : 3 * k + 3],
                        facets[slot, 3 * ((k + 1) % 3) : 3 * ((k + 1) % 3) + 3],
                    )
                    <= tolerance**2
                )
                edge = edges[order[slot], k]
                rim |= near[k] and edge >= 0 and edge_rim[edge]
            normal += _angle_at(near, facets[slot]) * facets[slot, 9:]
    length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if length > 1e-12:
        normal /= length
    else:
        normal[:] = 0.0
    return rim


@njit(cache=True)
def _to_segment(x, y, z, a, b):
    """Return the squared distance from a point to the segment ab."""
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    px, py, pz = x - a[0], y - a[1], z - a[2]
    along, whole = ex * px + ey * py + ez * pz, ex * ex + ey * ey + ez * ez
    t = min(max(along / whole, 0.0), 1.0) if whole > 0 else 0.0
    return (px - t * ex) ** 2 + (py - t * ey) ** 2 + (pz - t * ez) ** 2


@njit(cache=True)
def _angle_at(near, facet):
    """Return the angle a facet takes up around a point near the given edges of it."""
    touched = near[0] + near[1] + near[2]
    if touched == 0:
        return 2 * math.pi
    if touched == 1:
        return math.pi
    if touched == 3:
        return 0.0
    k = 0
    while not (near[k] and near[(k + 2) % 3]):
        k += 1
    a, b, c = 3 * k, 3 * ((k + 1) % 3), 3 * ((k + 2) % 3)
    u, v = facet[b : b + 3] - facet[a : a + 3], facet[c : c + 3] - facet[a : a + 3]
    w = np.cross(u, v)
    return math.atan2(math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2), u[0] * v[0] + u[1] * v[1] + u[2] * v[2])


@njit(cache=True)
def morton_keys(points, centre, size):
    """Return for each point (n, 3) the number of its cell along a curve that keeps neighbours together.

    The cells divide a cube of twice the size about the centre in 128 along each axis; points outside go to its border.

    Notes
    -----
    G. M. Morton, "A computer oriented geodetic data base", IBM, 1966: the digits of the cell's three numbers, interleaved.
    """
    keys = np.empty(len(points), dtype=np.int32)
    scale = 64 / size
    for i in range(len(points)):
        key = 0
        for axis in range(3):
            cell = int(min(max((points[i, axis] - centre[axis]) * scale + 64, 0.0), 127.0))
            cell = (cell | (cell << 8)) & 0x00F00F
            cell = (cell | (cell << 4)) & 0x0C30C3
            cell = (cell | (cell << 2)) & 0x249249
            key |= cell << axis
        keys[i] = key
    return keys
