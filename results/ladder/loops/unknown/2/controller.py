import math
import heapq
import time
import numpy as np

RB = 8.0
AXLE = 9.0
VM = 3.0
TM = 2.0 * VM / AXLE           # 0.667 rad
NR = 72
RMAX = 120.0
RA = np.radians(-177.5 + 5.0 * np.arange(NR))
HALF = 330                     # px on each side of the start
N = 2 * HALF
KR = 14
CAP = 14.0
LIM = 8.16                     # clearance that is kept while driving
SUB = 2                        # marks of the hit points: 1/2 px

S = {}


def wrap(a):
    return (a + math.pi) % (2.0 * math.pi) - math.pi


def reset(obs):
    S.clear()
    S["n"] = 0
    # clr[i, j]: distance from the point (x, y) = (j - HALF, i - HALF) to the nearest hit
    S["clr"] = np.full((N, N), CAP, dtype=np.float32)
    S["mark"] = np.zeros((N * SUB, N * SUB), dtype=bool)
    S["seen"] = np.zeros((N // 2, N // 2), dtype=bool)
    S["pen"] = np.zeros((N // 2, N // 2), dtype=np.float32)
    S["goal"] = (float(obs["goal"][0]), float(obs["goal"][1]))
    S["path"] = []
    S["plan_n"] = -100
    S["hist"] = []
    S["recover"] = 0
    S["rec_dir"] = 0.0
    S["stuck"] = 0
    S["back"] = False
    S["box"] = [min(0.0, S["goal"][0]), max(0.0, S["goal"][0]),
                min(0.0, S["goal"][1]), max(0.0, S["goal"][1])]


def stamp(x, y):
    j = int(round(x)) + HALF
    i = int(round(y)) + HALF
    a0, a1 = max(i - KR, 0), min(i + KR + 1, N)
    b0, b1 = max(j - KR, 0), min(j + KR + 1, N)
    if a0 >= a1 or b0 >= b1:
        return
    dy = np.arange(a0 - HALF, a1 - HALF) - y
    dx = np.arange(b0 - HALF, b1 - HALF) - x
    d = np.sqrt((dy * dy)[:, None] + (dx * dx)[None, :]).astype(np.float32)
    v = S["clr"][a0:a1, b0:b1]
    np.minimum(v, d, out=v)


def update_map(x, y, h, rng):
    a = h + RA
    ca = np.cos(a)
    sa = np.sin(a)
    hit = rng < RMAX - 0.5
    hx = x + rng * ca
    hy = y + rng * sa
    mark = S["mark"]
    box = S["box"]
    for k in np.nonzero(hit)[0]:
        px = float(hx[k])
        py = float(hy[k])
        mi = int(math.floor((py + HALF) * SUB))
        mj = int(math.floor((px + HALF) * SUB))
        if 0 <= mi < N * SUB and 0 <= mj < N * SUB and not mark[mi, mj]:
            mark[mi, mj] = True
            stamp(px, py)
            if px < box[0]:
                box[0] = px
            if px > box[1]:
                box[1] = px
            if py < box[2]:
                box[2] = py
            if py > box[3]:
                box[3] = py
    # a corner between neighbouring rays that are close together: fill in the chord
    for k in range(NR - 1):
        if hit[k] and hit[k + 1] and rng[k] < 30.0 and rng[k + 1] < 30.0:
            d = math.hypot(hx[k + 1] - hx[k], hy[k + 1] - hy[k])
            if 0.9 < d < 2.6:
                px = 0.5 * float(hx[k] + hx[k + 1])
                py = 0.5 * float(hy[k] + hy[k + 1])
                mi = int(math.floor((py + HALF) * SUB))
                mj = int(math.floor((px + HALF) * SUB))
                if 0 <= mi < N * SUB and 0 <= mj < N * SUB and not mark[mi, mj]:
                    mark[mi, mj] = True
                    stamp(px, py)
    # floor that was seen
    t = np.arange(0.0, RMAX, 2.0)
    ok = t[None, :] < (rng[:, None] - 1.0)
    fx = (x + t[None, :] * ca[:, None])[ok]
    fy = (y + t[None, :] * sa[:, None])[ok]
    j = np.clip((np.rint(fx).astype(np.int64) + HALF) // 2, 0, N // 2 - 1)
    i = np.clip((np.rint(fy).astype(np.int64) + HALF) // 2, 0, N // 2 - 1)
    S["seen"][i, j] = True


def clr_at(x, y):
    g = x + HALF
    q = y + HALF
    j = int(math.floor(g))
    i = int(math.floor(q))
    if i < 0 or j < 0 or i >= N - 1 or j >= N - 1:
        return 0.0
    fx = g - j
    fy = q - i
    c = S["clr"]
    return float((c[i, j] * (1.0 - fx) + c[i, j + 1] * fx) * (1.0 - fy)
                 + (c[i + 1, j] * (1.0 - fx) + c[i + 1, j + 1] * fx) * fy)


def clr_many(x, y):
    g = np.clip(x + HALF, 0.0, N - 1.001)
    q = np.clip(y + HALF, 0.0, N - 1.001)
    j = g.astype(np.int64)
    i = q.astype(np.int64)
    fx = g - j
    fy = q - i
    c = S["clr"]
    return (c[i, j] * (1.0 - fx) + c[i, j + 1] * fx) * (1.0 - fy) + \
        (c[i + 1, j] * (1.0 - fx) + c[i + 1, j + 1] * fx) * fy


# ---------------------------------------------------------------- plan

def plan(x, y):
    gx, gy = S["goal"]
    box = S["box"]
    H2 = HALF // 2
    M = N // 2
    # crop: coarse cell k holds the fine cells 2k and 2k+1
    m = 14
    j0 = min(max(int(min(box[0], x)) // 2 + H2 - m, 0), M - 1)
    j1 = min(max(int(max(box[1], x)) // 2 + H2 + m, 1), M)
    i0 = min(max(int(min(box[2], y)) // 2 + H2 - m, 0), M - 1)
    i1 = min(max(int(max(box[3], y)) // 2 + H2 + m, 1), M)
    f = S["clr"][2 * i0:2 * i1, 2 * j0:2 * j1]
    q = np.stack([f[0::2, 0::2], f[0::2, 1::2], f[1::2, 0::2], f[1::2, 1::2]])
    c = q.max(axis=0)
    arg = q.argmax(axis=0)
    cost = 1.0 + 1.6 * np.clip((11.0 - c) / 3.0, 0.0, 1.0) ** 2
    cost += 0.12 * (~S["seen"][i0:i1, j0:j1])
    cost += S["pen"][i0:i1, j0:j1]
    low = c < 8.22
    cost[low] += 3.0
    low = c < 8.08
    cost[low] += 60.0
    cost[c < 7.6] = 0.0
    cost[0, :] = 0.0
    cost[-1, :] = 0.0
    cost[:, 0] = 0.0
    cost[:, -1] = 0.0
    hgt, wid = cost.shape
    si = min(max((int(round(y)) + HALF) // 2 - i0, 1), hgt - 2)
    sj = min(max((int(round(x)) + HALF) // 2 - j0, 1), wid - 2)
    ti = min(max((int(round(gy)) + HALF) // 2 - i0, 1), hgt - 2)
    tj = min(max((int(round(gx)) + HALF) // 2 - j0, 1), wid - 2)
    if cost[si, sj] <= 0.0:
        cost[si, sj] = 5.0
    if cost[ti, tj] <= 0.0:
        cost[ti, tj] = 5.0
    W = cost.ravel().tolist()
    src = si * wid + sj
    dst = ti * wid + tj
    d1 = 0.5
    d2 = 0.5 * math.sqrt(2.0)
    nb = [(1, d1), (-1, d1), (wid, d1), (-wid, d1),
          (wid + 1, d2), (wid - 1, d2), (-wid + 1, d2), (-wid - 1, d2)]
    inf = 1e18
    dist = [inf] * len(W)
    par = [-1] * len(W)
    done = bytearray(len(W))
    dist[src] = 0.0
    heap = [(0.0, src)]
    pop = heapq.heappop
    push = heapq.heappush
    found = False
    while heap:
        u = pop(heap)[1]
        if u == dst:
            found = True
            break
        if done[u]:
            continue
        done[u] = 1
        du = dist[u]
        wu = W[u]
        for off, ln in nb:
            v = u + off
            wv = W[v]
            if wv <= 0.0 or done[v]:
                continue
            nd = du + ln * (wu + wv)
            if nd < dist[v]:
                dist[v] = nd
                par[v] = u
                a = v // wid - ti
                b = v % wid - tj
                if a < 0:
                    a = -a
                if b < 0:
                    b = -b
                push(heap, (nd + (a + b - 0.58579 * (a if a < b else b)), v))
    path = []
    if found:
        u = dst
        while u != -1:
            i, j = u // wid, u % wid
            k = int(arg[i, j])
            if c[i, j] < 10.0:
                px = 2 * (j + j0) + (k & 1) - HALF
                py = 2 * (i + i0) + (k >> 1) - HALF
            else:
                px = 2 * (j + j0) + 0.5 - HALF
                py = 2 * (i + i0) + 0.5 - HALF
            path.append((float(px), float(py)))
            u = par[u]
        path.reverse()
        path = path[1:]
        path.append((gx, gy))
        # centre the next part of the way in narrow places
        for k in range(min(len(path) - 1, 40)):
            path[k] = refine(path[k])
    S["path"] = path
    S["plan_n"] = S["n"]
    return found


def refine(p):
    x, y = p
    c = clr_at(x, y)
    if c > 9.4:
        return p
    x0, y0 = x, y
    step = 0.5
    for _ in range(8):
        e = 0.25
        gx = clr_at(x + e, y) - clr_at(x - e, y)
        gy = clr_at(x, y + e) - clr_at(x, y - e)
        g = math.hypot(gx, gy)
        if g < 0.02:
            break
        nx = x + step * gx / g
        ny = y + step * gy / g
        nc = clr_at(nx, ny)
        if nc > c + 1e-4 and math.hypot(nx - x0, ny - y0) < 1.8:
            x, y, c = nx, ny, nc
            if c > 9.4:
                break
        else:
            step *= 0.5
    return x, y


def line_min(x0, y0, x1, y1):
    d = math.hypot(x1 - x0, y1 - y0)
    m = max(int(math.ceil(d / 0.8)), 1)
    t = np.arange(1, m + 1) / float(m)
    return float(clr_many(x0 + t * (x1 - x0), y0 + t * (y1 - y0)).min())


def path_blocked(x, y):
    p = S["path"][:60]
    if not p:
        return True
    a = np.array(p)
    c = clr_many(a[:, 0], a[:, 1])
    near = np.hypot(a[:, 0] - x, a[:, 1] - y) < 3.0
    c = np.where(near, 20.0, c)
    if len(S["path"]) <= 60:
        c[-1] = 20.0
    return bool(c.min() < 8.1)


# ---------------------------------------------------------------- drive

OFFS = [0.0, 0.08, -0.08, 0.16, -0.16, 0.28, -0.28, 0.42, -0.42, 0.6, -0.6,
        0.8, -0.8, 1.05, -1.05, 1.3, -1.3, 1.55, -1.55]


def allowed(c, c0, moved):
    if c >= LIM:
        return True
    return c > 8.02 and c >= c0 - 0.004 * moved or c > c0 + 0.2 * moved


def can_go(x, y, a, d, c0):
    m = max(int(math.ceil(d / 0.6)), 1)
    ca, sa = math.cos(a), math.sin(a)
    for k in range(1, m + 1):
        t = d * k / m
        if not allowed(clr_at(x + t * ca, y + t * sa), c0, t):
            return False
    return True


def arc_ok(x, y, th, v, turn, c0):
    """v px and turn rad in a step, tested along the arc"""
    n = 5
    for k in range(1, n + 1):
        f = k / n
        t = turn * f
        s = v * f
        if abs(t) > 1e-6:
            r = s / t
            nx = x + r * (math.sin(th + t) - math.sin(th))
            ny = y - r * (math.cos(th + t) - math.cos(th))
        else:
            nx = x + s * math.cos(th)
            ny = y + s * math.sin(th)
        if not allowed(clr_at(nx, ny), c0, abs(s)):
            return False
    return True


def drive(x, y, th, a, dist):
    """(left, right) to move in the direction a by about dist px"""
    c0 = clr_at(x, y)
    best = None
    for d in (min(3.0, max(dist, 0.8)), 0.9):
        for o in OFFS:
            if can_go(x, y, a + o, d, c0):
                best = a + o
                break
        if best is not None:
            break
    if best is None:
        best = a
    err = wrap(best - th)
    back = S["back"]
    if back:
        if abs(err) < 0.5 * math.pi - 0.25:
            back = False
    elif abs(err) > 0.5 * math.pi + 0.25:
        back = True
    S["back"] = back
    sg = 1.0
    if back:
        err = wrap(err + math.pi)
        sg = -1.0
    w = min(max(err / TM, -1.0), 1.0)
    if abs(err) > 0.62:
        v = 0.0
    else:
        v = 1.0 - abs(w)
    v = min(v, max(dist, 0.5) / VM)
    go = 0.0
    for f in (1.0, 0.75, 0.5, 0.3, 0.15):
        if v * f > 0.0 and arc_ok(x, y, th, sg * v * f * VM, w * TM, c0):
            go = v * f
            break
    if go < 0.1 and abs(w) < 0.12:
        # straight on is barred: creep, if that is safe
        for q in (0.25, 0.12, 0.05):
            if arc_ok(x, y, th, sg * q * VM, w * TM, c0):
                go = q
                break
    v = sg * go
    return v + w, v - w


def out(l, r):
    if not (math.isfinite(l) and math.isfinite(r)):
        return 0.0, 0.0
    return float(min(max(l, -1.0), 1.0)), float(min(max(r, -1.0), 1.0))


def policy(obs):
    if "n" not in S:
        reset(obs)
    S["n"] += 1
    n = S["n"]
    x, y, th = (float(v) for v in obs["pose"])
    rng = np.asarray(obs["ranges"], dtype=np.float64)
    update_map(x, y, th, rng)
    gx, gy = S["goal"]
    S["hist"].append((x, y))
    left = 2.0 + 0.02 * n - time.process_time()

    # no progress: go another way for a while
    if S["recover"] == 0 and len(S["hist"]) > 16:
        hx, hy = S["hist"][-16]
        if math.hypot(hx - x, hy - y) < 2.0:
            S["stuck"] += 1
            S["hist"] = []
            S["recover"] = 7
            k0 = S["stuck"]
            best = -1e9
            for k in range(24):
                a = 2.0 * math.pi * k / 24.0
                q = min(clr_at(x + 2.0 * math.cos(a), y + 2.0 * math.sin(a)),
                        clr_at(x + 5.0 * math.cos(a), y + 5.0 * math.sin(a)))
                q += 0.05 * ((k * 7 + k0 * 11) % 24) / 24.0
                if q > best:
                    best = q
                    S["rec_dir"] = a
            if S["path"]:
                p = S["path"][min(2, len(S["path"]) - 1)]
                i = (int(round(p[1])) + HALF) // 2
                j = (int(round(p[0])) + HALF) // 2
                S["pen"][max(i - 2, 0):i + 3, max(j - 2, 0):j + 3] += 3.0 * min(S["stuck"], 6)
            S["plan_n"] = -100
    if S["recover"] > 0:
        S["recover"] -= 1
        return out(*drive(x, y, th, S["rec_dir"], 3.0))

    age = n - S["plan_n"]
    period = 5 if left > 1.0 else (10 if left > 0.5 else 30)
    need = age >= period or not S["path"]
    if not need and left > 0.4 and path_blocked(x, y):
        need = True
    if need and left > 0.15:
        plan(x, y)
    path = S["path"]
    if not path:
        a = math.atan2(gy - y, gx - x)
        return out(*drive(x, y, th, a, 3.0))

    # drop what lies behind
    bi = 0
    bd = 1e9
    for k in range(min(len(path), 16)):
        d = math.hypot(path[k][0] - x, path[k][1] - y)
        if d < bd - 1e-9:
            bd = d
            bi = k
    if bi > 0:
        path = path[bi:]
    if len(path) > 1 and bd < 1.2:
        path = path[1:]
    S["path"] = path

    # the farthest point that can be reached along a straight line
    L = len(path)
    cp = clr_many(np.array([p[0] for p in path[:64]]), np.array([p[1] for p in path[:64]]))
    low = np.minimum.accumulate(cp)
    target = None
    idx = [k for k in (63, 50, 40, 32, 26, 21, 17, 14, 11, 9, 7, 6, 5, 4, 3, 2, 1) if k < L]
    if L <= 64 and (L - 1) not in idx:
        idx.insert(0, L - 1)
    for k in idx:
        lim = max(min(8.7, float(low[k]) - 0.08), 8.2)
        if k == L - 1 and L <= 64:
            # the goal itself: within 4 px of it is enough
            d = math.hypot(gx - x, gy - y)
            f = max(d - 3.5, 0.0) / max(d, 1e-6)
            if line_min(x, y, x + f * (gx - x), y + f * (gy - y)) >= LIM + 0.02:
                target = path[k]
                break
            continue
        if line_min(x, y, path[k][0], path[k][1]) >= lim:
            target = path[k]
            break
    if target is None:
        target = path[0]
        if math.hypot(target[0] - x, target[1] - y) < 0.8 and L > 1:
            target = path[1]
    dx = target[0] - x
    dy = target[1] - y
    d = math.hypot(dx, dy)
    return out(*drive(x, y, th, math.atan2(dy, dx), max(d, 1.0)))
