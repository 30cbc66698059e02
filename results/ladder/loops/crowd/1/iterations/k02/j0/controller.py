import heapq
import math
import time

import numpy as np

PAD = 4
EDGE = 100            # border of the arrays from which the local grid is cut
BODY = 8.0
WALL = 8.35
STEP = 3.0            # px per step at full speed
TURN = 2.0 / 3.0      # rad per step at full speed on the spot
N_RAYS = 72
INF = float("inf")
PI = math.pi
BIG = 1.0e4

# times of the predictions: exact roll-outs, then the grid, then those who come by later
NR = 8
NG = 10
DTS = np.array([0.1] * NR + [0.2] * NG + [0.4] * 3)
TEND = np.cumsum(DTS)
TBEG = TEND - DTS
NT = len(DTS)
TR = TEND[:NR]
TG = TEND[NR:]

R_HARD = 600.0 * np.exp(-TR / 1.5)
R_CONT = 0.15 + 0.3 * TR
R_SOFT = 20.0 * np.exp(-TR / 0.5) + 5.0
R_MARG = 1.5 + 1.0 * TR
G_HARD = 250.0 * np.exp(-TG / 2.0)
G_HARD[NG:] = 30.0
G_CONT = np.minimum(0.3 + 0.3 * TG, 1.0)
G_SOFT = np.full(len(TG), 10.0)
G_SOFT[NG:] = 5.0
G_MARG = np.minimum(1.5 + 1.0 * TG, 4.0)
G_HARD = G_HARD.astype(np.float32)[:, None, None]
G_CONT = G_CONT.astype(np.float32)[:, None, None]
G_SOFT = G_SOFT.astype(np.float32)[:, None, None]
G_MARG = G_MARG.astype(np.float32)[:, None, None]

CELL = 3
HALF = 30
SIDE = 2 * HALF + 1
SPAN = CELL * HALF

DYN_OFF = (0.0, 0.08, -0.08, 0.17, -0.17, 0.3, -0.3)
SWERVE = 0.3          # rad, other futures of a mover


def wrap(a):
    return (a + PI) % (2.0 * PI) - PI


def distance_to(mask):
    """Distance of the pixel centres to the squares of the pixels in mask (capped)."""
    h, w = mask.shape
    g = np.empty((h, w))
    d = np.full(w, 60.0)
    for y in range(h):
        d = np.where(mask[y], 0.0, np.minimum(d + 1.0, 60.0))
        g[y] = d
    d = np.full(w, 60.0)
    for y in range(h - 1, -1, -1):
        d = np.where(mask[y], 0.0, np.minimum(d + 1.0, 60.0))
        g[y] = np.minimum(g[y], d)
    g = np.maximum(g - 0.5, 0.0) ** 2
    best = g.copy()
    for dx in range(1, min(42, w - 1)):
        off = (dx - 0.5) ** 2
        best[:, dx:] = np.minimum(best[:, dx:], g[:, :-dx] + off)
        best[:, :-dx] = np.minimum(best[:, :-dx], g[:, dx:] + off)
    return np.minimum(np.sqrt(best), 42.0)


def spread4(a):
    r = a.copy()
    np.minimum(r[1:], a[:-1], out=r[1:])
    np.minimum(r[:-1], a[1:], out=r[:-1])
    np.minimum(r[:, 1:], a[:, :-1], out=r[:, 1:])
    np.minimum(r[:, :-1], a[:, 1:], out=r[:, :-1])
    return r


def spread8(a):
    r = a.copy()
    np.minimum(r[1:], a[:-1], out=r[1:])
    np.minimum(r[:-1], a[1:], out=r[:-1])
    s = r.copy()
    np.minimum(s[:, 1:], r[:, :-1], out=s[:, 1:])
    np.minimum(s[:, :-1], r[:, 1:], out=s[:, :-1])
    return s


def make_candidates():
    """Rows: c1x c1y follow1 speed1 t1 c2x c2y follow2 speed2; and the offsets of the rows
    whose first direction is relative to the present heading."""
    rows = []

    def add(a, t1, b):
        rows.append(list(a) + [t1] + list(b))

    follow = (0.0, 0.0, 1.0, 1.0)
    back = (0.0, 0.0, -1.0, 1.0)
    stop = (0.0, 0.0, 1.0, 0.0)

    def slow(base, s):
        return (base[0], base[1], base[2], s)

    def fixed(ang, s):
        return (math.cos(ang), math.sin(ang), 0.0, s)

    add(follow, 99.0, follow)
    add(stop, 99.0, stop)
    add(back, 99.0, back)
    for s in (0.75, 0.5, 0.25):
        add(slow(follow, s), 99.0, slow(follow, s))
        add(slow(back, s), 99.0, slow(back, s))
        add(slow(follow, s), 0.3, follow)
    for t in (0.1, 0.2, 0.4, 0.6):
        add(stop, t, follow)
        add(stop, t, back)
        add(follow, t, stop)
        add(follow, t, back)
        add(back, t, follow)
        add(back, t, stop)
    n = 32
    for i in range(n):
        a = 2.0 * PI * i / n
        for t in (0.2, 0.4):
            add(fixed(a, 1.0), t, follow)
            add(fixed(a, 1.0), t, stop)
        add(fixed(a, 1.0), 99.0, stop)
        add(fixed(a, 0.5), 99.0, stop)
    n = 16
    for i in range(n):
        a = 2.0 * PI * i / n
        for da in (-PI / 2, -PI / 4, PI / 4, PI / 2):
            add(fixed(a, 1.0), 0.4, fixed(a + da, 1.0))
    first = len(rows)
    offs = []
    for base in (0.0, PI):
        for o in DYN_OFF:
            add(fixed(base + o, 1.0), 99.0, stop)
            offs.append(base + o)
            add(fixed(base + o, 1.0), 0.3, follow)
            offs.append(base + o)
    rows.append(rows[0])          # place of the last choice
    return np.array(rows), first, np.array(offs)


class Track:
    def __init__(self, x, y, var, r, known):
        self.x = x
        self.y = y
        self.vx = 0.0
        self.vy = 0.0
        self.mx = 0.0             # slow mean of the velocity
        self.my = 0.0
        self.pp = var
        self.pv = 0.0
        self.vv = 200.0
        self.r = r
        self.known = known
        self.age = 0
        self.miss = 0.0
        self.unseen = 0

    def predict(self, dt):
        q = 900.0
        self.x += self.vx * dt
        self.y += self.vy * dt
        self.pp += 2 * dt * self.pv + dt * dt * self.vv + q * dt ** 4 / 4
        self.pv += dt * self.vv + q * dt ** 3 / 2
        self.vv = min(self.vv + q * dt * dt, 300.0)

    def update(self, zx, zy, var):
        s = self.pp + var
        k1 = self.pp / s
        k2 = self.pv / s
        ex = zx - self.x
        ey = zy - self.y
        self.x += k1 * ex
        self.y += k1 * ey
        self.vx += k2 * ex
        self.vy += k2 * ey
        self.vv = max(self.vv - k2 * self.pv, 0.5)
        self.pv = (1 - k1) * self.pv
        self.pp = (1 - k1) * self.pp
        sp = math.hypot(self.vx, self.vy)
        if sp > 25.0:
            self.vx *= 25.0 / sp
            self.vy *= 25.0 / sp
        self.age += 1
        g = 0.14 if self.age > 5 else 1.0
        self.mx += g * (self.vx - self.mx)
        self.my += g * (self.vy - self.my)
        self.miss = 0.0
        self.unseen = 0


def fit_circle(pts):
    n = len(pts)
    mx = sum(p[0] for p in pts) / n
    my = sum(p[1] for p in pts) / n
    suu = suv = svv = bu = bv = 0.0
    for p in pts:
        u = p[0] - mx
        v = p[1] - my
        q = u * u + v * v
        suu += u * u
        suv += u * v
        svv += v * v
        bu += u * q
        bv += v * q
    det = suu * svv - suv * suv
    if abs(det) < 1e-7:
        return None
    uc = 0.5 * (bu * svv - bv * suv) / det
    vc = 0.5 * (bv * suu - bu * suv) / det
    r = math.sqrt(uc * uc + vc * vc + (suu + svv) / n)
    cx = mx + uc
    cy = my + vc
    res = max(abs(math.hypot(p[0] - cx, p[1] - cy) - r) for p in pts)
    return cx, cy, r, res


def good_fit(pts, rx, ry):
    if len(pts) < 3:
        return None
    f = fit_circle(pts)
    if f is None:
        return None
    cx, cy, r, res = f
    if r < 4.8 or r > 8.2 or res > 0.15:
        return None
    near = min(math.hypot(p[0] - rx, p[1] - ry) for p in pts)
    if math.hypot(cx - rx, cy - ry) < near:
        return None
    return cx, cy, r


def centre_from(pts, r, rx, ry):
    """Centre of a disc of radius r from one or two points (or a poor set) on it."""
    if len(pts) == 2:
        (ax, ay), (bx, by) = pts
        d = math.hypot(bx - ax, by - ay)
        if d > 1e-6:
            r = max(r, d / 2 + 0.05)
            mx = (ax + bx) / 2
            my = (ay + by) / 2
            nx = -(by - ay) / d
            ny = (bx - ax) / d
            if nx * (mx - rx) + ny * (my - ry) < 0:
                nx, ny = -nx, -ny
            h = math.sqrt(max(r * r - d * d / 4, 0.0))
            return mx + nx * h, my + ny * h
    p = min(pts, key=lambda c: math.hypot(c[0] - rx, c[1] - ry))
    d = max(math.hypot(p[0] - rx, p[1] - ry), 1e-6)
    return p[0] + (p[0] - rx) / d * r, p[1] + (p[1] - ry) / d * r


def explain(pts, rx, ry):
    """Split a run of neighbouring hits into discs: list of (pts, cx, cy, r, exact)."""
    n = len(pts)
    f = good_fit(pts, rx, ry)
    if f is not None:
        return [(pts, f[0], f[1], f[2], True)]
    if n == 1 or (n == 2 and math.dist(pts[0], pts[1]) <= 13.0):
        c = centre_from(pts, 6.5, rx, ry)
        return [(pts, c[0], c[1], 6.5, False)]
    best = 0
    cut = 0
    for k in range(1, n):
        s = 0
        if good_fit(pts[:k], rx, ry) is not None:
            s += k
        if good_fit(pts[k:], rx, ry) is not None:
            s += n - k
        if s > best:
            best = s
            cut = k
    if best == 0:
        if n > 2:
            c = centre_from(pts, 6.5, rx, ry)
            if all(abs(math.dist(p, c) - 6.5) < 1.6 for p in pts):
                return [(pts, c[0], c[1], 6.5, False)]
        cut = max(range(1, n), key=lambda k: math.dist(pts[k - 1], pts[k]))
    return explain(pts[:cut], rx, ry) + explain(pts[cut:], rx, ry)


class Controller:
    def __init__(self, obs):
        occ = np.load("occupancy.npy").astype(bool)
        self.h, self.w = occ.shape
        occ = np.pad(occ, PAD, constant_values=True)
        self.W = occ.shape[1]
        clear = distance_to(occ)
        self.clear = clear
        self.cf = clear.ravel()
        gy, gx = np.gradient(clear)
        nrm = np.hypot(gx, gy) + 1e-6
        self.gx = (gx / nrm).ravel()
        self.gy = (gy / nrm).ravel()
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))
        pose = obs["pose"]
        wide = clear >= 15.5
        if wide.any():
            narrow = distance_to(wide) > 16.2
        else:
            narrow = np.zeros_like(wide)
        for thr in (10.0, 9.2, 8.6, 8.0):
            if self.plan(thr, narrow, float(pose[0]), float(pose[1])):
                break
        inner = clear[PAD:PAD + self.h, PAD:PAD + self.w]
        self.c_big = np.pad(inner, EDGE).astype(np.float32)
        yy, xx = np.mgrid[0:self.h, 0:self.w]
        v = self.value_at(xx.ravel().astype(float), yy.ravel().astype(float))
        v = np.minimum(v.reshape(self.h, self.w), 5000.0)
        self.v_big = np.pad(v, EDGE, constant_values=5000.0).astype(np.float32)

        self.cands, self.dyn, self.dyn_offs = make_candidates()
        full = np.arange(len(self.cands))
        last = len(full) - 1
        self.small = np.concatenate([full[:36:2], full[36:last:3], full[last:]])
        self.gl = 1.0
        self.gr = 1.0
        self.last = None
        self.tracks = []
        self.prev = None
        self.n = 0
        self.t0 = None
        self.best_v = INF
        self.best_n = 0
        self.short_until = -1

    # ---------------------------------------------------------------- global plan
    def plan(self, thr, narrow, sx, sy):
        gx, gy = self.goal
        c2 = self.clear[PAD:PAD + self.h:2, PAD:PAD + self.w:2]
        n2 = narrow[PAD:PAD + self.h:2, PAD:PAD + self.w:2]
        mult = 1.0 + 0.9 * np.clip((15.0 - c2) / 6.5, 0.0, 1.0) ** 2 + 0.5 * n2
        mult = np.where(c2 >= thr, mult, 0.0)
        mult = np.pad(mult, 2)
        body_ok = np.pad(c2 >= 8.0, 2).ravel()
        hh, ww = mult.shape
        self.w2 = ww
        n = hh * ww
        idx = np.arange(n)
        nx = ((idx % ww) - 2) * 2.0
        ny = ((idx // ww) - 2) * 2.0
        mf = mult.ravel()
        to_goal = np.hypot(nx - gx, ny - gy)
        dist = np.where(mf > 0, to_goal, 1e9)
        seeds = np.nonzero(dist <= 5.0)[0]
        if len(seeds) == 0:
            seeds = np.array([int(np.argmin(dist))])
        m = mf.tolist()
        val = [INF] * n
        par = list(range(n))
        heap = []
        for s in seeds.tolist():
            val[s] = float(dist[s])
            heap.append((val[s], s))
        heapq.heapify(heap)
        nb = []
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                if max(abs(dx), abs(dy)) == 1 or (abs(dx) + abs(dy) == 3):
                    nb.append((dy * ww + dx, math.hypot(dx, dy)))
        push = heapq.heappush
        pop = heapq.heappop
        while heap:
            d, u = pop(heap)
            if d > val[u]:
                continue
            mu = m[u]
            for off, half in nb:
                v = u + off
                mv = m[v]
                if mv:
                    nd = d + half * (mu + mv)
                    if nd < val[v] - 1e-9:
                        val[v] = nd
                        par[v] = u
                        push(heap, (nd, v))
        V = np.array(val).reshape(hh, ww)
        P = np.array(par).reshape(hh, ww)
        ids = idx.reshape(hh, ww)
        for _ in range(4):
            newv = V.copy()
            newp = P.copy()
            for dy in (-1, 0, 1):
                for dx in (-1, 0, 1):
                    if dx == 0 and dy == 0:
                        continue
                    cv = np.roll(V, (dy, dx), (0, 1)) + 3.0 * math.hypot(dx, dy)
                    up = np.isinf(V) & (cv < newv)
                    newv = np.where(up, cv, newv)
                    newp = np.where(up, np.roll(ids, (dy, dx), (0, 1)), newp)
            V = newv
            P = newp
        start = (int(sy * 0.5 + 2.5)) * ww + int(sx * 0.5 + 2.5)
        Vf = V.ravel().copy()
        ok = bool(np.isfinite(Vf[start]))
        fin = Vf[np.isfinite(Vf)]
        top = float(fin.max()) if len(fin) else 0.0
        at = (to_goal <= 6.0) & body_ok
        Vf = np.where(at, np.minimum(Vf, to_goal), Vf)
        Pf = P.ravel()
        a2 = Pf[Pf]
        a5 = Pf[a2[a2]]
        a7 = a2[a5]
        self.targets = []
        for a in (a7, a2):
            at_goal = Vf[a] <= 5.5
            self.targets.append((np.where(at_goal, gx, nx[a]), np.where(at_goal, gy, ny[a])))
        self.V = np.where(np.isfinite(Vf), Vf, top + 200.0)
        return ok

    # ---------------------------------------------------------------- look-ups
    def clear_at(self, x, y):
        x = np.clip(x + PAD, 0.0, self.W - 2.001)
        y = np.clip(y + PAD, 0.0, self.clear.shape[0] - 2.001)
        ix = x.astype(np.int64)
        iy = y.astype(np.int64)
        fx = x - ix
        fy = y - iy
        i = iy * self.W + ix
        c = self.cf
        a = c[i]
        a = a + (c[i + 1] - a) * fx
        i = i + self.W
        b = c[i]
        b = b + (c[i + 1] - b) * fx
        return a + (b - a) * fy

    def near_index(self, x, y):
        ix = np.clip((x + (PAD + 0.5)).astype(np.int64), 0, self.W - 1)
        iy = np.clip((y + (PAD + 0.5)).astype(np.int64), 0, self.clear.shape[0] - 1)
        return iy * self.W + ix

    def value_at(self, x, y):
        x = x * 0.5 + 2.0
        y = y * 0.5 + 2.0
        ix = x.astype(np.int64)
        iy = y.astype(np.int64)
        fx = x - ix
        fy = y - iy
        i = iy * self.w2 + ix
        v = self.V
        a = v[i] * (1 - fx) + v[i + 1] * fx
        i = i + self.w2
        b = v[i] * (1 - fx) + v[i + 1] * fx
        return a * (1 - fy) + b * fy

    # ---------------------------------------------------------------- gains
    def estimate_gains(self, x, y, th):
        if self.last is None:
            return
        px, py, pth, l, r = self.last
        d = wrap(th - pth)
        mid = pth + d / 2
        s = (x - px) * math.cos(mid) + (y - py) * math.sin(mid)
        if abs(d) > 1e-4:
            s *= (d / 2) / math.sin(d / 2)
        a = 2.0 * s / STEP
        b = 3.0 * d
        le = (a + b) / 2
        re = (a - b) / 2
        if abs(l) > 0.15:
            g = le / l
            if 0.85 < g < 1.15:
                self.gl = g if abs(le) < 0.995 else max(self.gl, g)
        if abs(r) > 0.15:
            g = re / r
            if 0.85 < g < 1.15:
                self.gr = g if abs(re) < 0.995 else max(self.gr, g)

    # ---------------------------------------------------------------- discs
    def detect(self, x, y, th, ranges):
        ang = th + np.radians(-177.5 + 5.0 * np.arange(N_RAYS))
        hx = x + ranges * np.cos(ang)
        hy = y + ranges * np.sin(ang)
        hit = (ranges < 119.9) & (self.clear_at(hx, hy) > 0.8)
        if not hit.any():
            return []
        first = 0
        for i in range(N_RAYS):
            if not hit[i] and not hit[i - 1]:
                first = i
                break
        runs = []
        cur = []
        gap = 0
        for k in range(N_RAYS):
            i = (first + k) % N_RAYS
            if hit[i]:
                p = (float(hx[i]), float(hy[i]))
                if cur and (gap > 1 or math.dist(cur[-1], p) > 14.0):
                    runs.append(cur)
                    cur = []
                cur.append(p)
                gap = 0
            else:
                # a dropout may lie within a disc; a ray on a wall parts two runs
                gap += 1 if ranges[i] >= 119.9 else 5
        if cur:
            runs.append(cur)
        out = []
        for run in runs:
            out.extend(explain(run, x, y))
        return out

    def track(self, x, y, th, ranges):
        dets = self.detect(x, y, th, ranges)
        if self.n > 0:
            for t in self.tracks:
                t.predict(0.1)
                if t.unseen > 0 or t.miss > 0:
                    i = self.near_index(np.array([t.x]), np.array([t.y]))[0]
                    if self.cf[i] < t.r:
                        dot = t.vx * self.gx[i] + t.vy * self.gy[i]
                        if dot < 0:
                            t.vx -= dot * self.gx[i]
                            t.vy -= dot * self.gy[i]
                        push = t.r - self.cf[i]
                        t.x += push * self.gx[i]
                        t.y += push * self.gy[i]
        pairs = []
        for a, t in enumerate(self.tracks):
            for b, d in enumerate(dets):
                q = math.hypot(t.x - d[1], t.y - d[2])
                if q < (6.0 if d[4] else 9.0):
                    pairs.append((q, a, b))
        pairs.sort()
        used_t = set()
        used_d = set()
        for q, a, b in pairs:
            if a in used_t or b in used_d:
                continue
            used_t.add(a)
            used_d.add(b)
            t = self.tracks[a]
            pts, cx, cy, r, exact = dets[b]
            if exact:
                if not t.known:
                    t.r = r
                else:
                    g = 0.7 if len(pts) >= 5 else 0.4
                    t.r += g * (r - t.r)
                t.known = True
                t.update(cx, cy, 0.015)
            elif len(pts) == 2:
                cx, cy = centre_from(pts, t.r, x, y)
                t.update(cx, cy, 0.06 if t.known else 0.7)
            else:
                p = min(pts, key=lambda c: math.hypot(c[0] - x, c[1] - y))
                ux = t.x - p[0]
                uy = t.y - p[1]
                n = math.hypot(ux, uy)
                if n > 2.0 and ux * (p[0] - x) + uy * (p[1] - y) > 0:
                    t.update(p[0] + ux / n * t.r, p[1] + uy / n * t.r,
                             0.8 if t.known else 2.5)
                else:
                    t.update(cx, cy, 5.0)
        keep = []
        for a, t in enumerate(self.tracks):
            if a not in used_t:
                d = math.hypot(t.x - x, t.y - y)
                b = math.degrees(wrap(math.atan2(t.y - y, t.x - x) - th))
                rr = ranges[int(round((b + 177.5) / 5.0)) % N_RAYS]
                if d > 118.0:
                    t.unseen += 2
                elif rr >= 119.9:
                    t.miss += 0.5
                elif rr > d + 1.0:
                    t.miss += 1.0
                else:
                    t.unseen += 1
                if t.miss >= 2.5 or t.unseen > 18:
                    continue
            keep.append(t)
        for b, d in enumerate(dets):
            if b in used_d:
                continue
            pts, cx, cy, r, exact = d
            if any(math.hypot(t.x - cx, t.y - cy) < 5.0 for t in keep):
                continue
            keep.append(Track(cx, cy, 0.015 if exact else (1.0 if len(pts) == 2 else 6.0), r, exact))
        self.tracks = keep

    def predict_tracks(self, x, y, most):
        near = sorted(self.tracks, key=lambda t: math.hypot(t.x - x, t.y - y))[:most]
        near = [t for t in near if math.hypot(t.x - x, t.y - y) < 135.0]
        if not near:
            return None
        px = np.array([t.x for t in near])
        py = np.array([t.y for t in near])
        vx = np.array([t.vx for t in near])
        vy = np.array([t.vy for t in near])
        mx = np.array([t.mx for t in near])
        my = np.array([t.my for t in near])
        r0 = np.array([t.r for t in near])
        rad = np.array([(t.r + 0.1 if t.known else t.r + 0.8)
                        + min(1.0, 0.4 * math.sqrt(max(t.pp, 0.0))) for t in near])
        # other futures within the roll-outs: swerve to either side, or halt
        c, s = math.cos(SWERVE), math.sin(SWERVE)
        alt = []
        for ax, ay in ((c * vx - s * vy, s * vx + c * vy), (c * vx + s * vy, c * vy - s * vx),
                       (0.2 * vx, 0.2 * vy)):
            alt.append((px[:, None] + ax[:, None] * TR, py[:, None] + ay[:, None] * TR))
        X = np.empty((len(near), NT))
        Y = np.empty((len(near), NT))
        sp = np.hypot(vx, vy)
        mixed = False
        for k in range(NT):
            dt = DTS[k]
            if not mixed and TBEG[k] > 0.45:
                # evasions are short: later on, half of the usual velocity counts
                vx = 0.5 * (vx + mx)
                vy = 0.5 * (vy + my)
                sp = np.hypot(vx, vy)
                mixed = True
            i = self.near_index(px + vx * dt, py + vy * dt)
            gx = self.gx[i]
            gy = self.gy[i]
            dot = np.where(self.cf[i] < r0 + 0.2, np.minimum(vx * gx + vy * gy, 0.0), 0.0)
            vx = vx - dot * gx
            vy = vy - dot * gy
            ns = np.hypot(vx, vy)
            f = np.where((dot < 0) & (ns > 0.25 * sp), sp / (ns + 1e-6), 1.0)
            vx = vx * f
            vy = vy * f
            px = px + vx * dt
            py = py + vy * dt
            X[:, k] = px
            Y[:, k] = py
        return X, Y, rad, alt

    # ---------------------------------------------------------------- space-time grid
    def grid_values(self, x, y, pred):
        """Cost to go from 0.8 s on, on a grid around the robot."""
        xi = int(round(x))
        yi = int(round(y))
        rows = slice(yi + EDGE - SPAN, yi + EDGE + SPAN + 1, CELL)
        cols = slice(xi + EDGE - SPAN, xi + EDGE + SPAN + 1, CELL)
        V = self.v_big[rows, cols]
        blocked = self.c_big[rows, cols] < 8.4
        k = CELL * (np.arange(SIDE) - HALF)
        xs = (xi + k).astype(np.float32)
        ys = (yi + k).astype(np.float32)
        gx, gy = self.goal
        at_goal = ((xs - gx) ** 2)[None, :] + ((ys - gy) ** 2)[:, None] <= 3.2 ** 2
        J = V.copy()
        risk = None
        if pred is not None:
            PX, PY, rad, _ = pred
            gap = np.full((len(TG), SIDE, SIDE), 50.0, dtype=np.float32)
            for m in range(len(rad)):
                dx2 = ((xs[None, :] - PX[m, NR:, None]) ** 2).astype(np.float32)
                dy2 = ((ys[None, :] - PY[m, NR:, None]) ** 2).astype(np.float32)
                d = dx2[:, None, :] + dy2[:, :, None]
                np.sqrt(d, out=d)
                d -= np.float32(BODY + rad[m])
                np.minimum(gap, d, out=gap)
            soft = np.clip(1.0 - gap / G_MARG, 0.0, 1.0)
            risk = G_SOFT * soft * soft + G_HARD * (gap < G_CONT)
            J = J + risk[NG] + risk[NG + 1] + risk[NG + 2]
        run = V * np.float32(0.02)
        J[blocked] = BIG
        J[at_goal] = -10.0
        for i in range(NG - 1, -1, -1):
            J = J + run
            if risk is not None:
                J = J + risk[i]
            J[blocked] = BIG
            J[at_goal] = -10.0
            J = spread8(spread4(J))
        J[blocked] = BIG
        J[at_goal] = -10.0
        for _ in range(2):
            # the cells beside the free ones, so that values can be interpolated
            J = np.where(J >= BIG * 0.5, spread8(J) + np.float32(4.0), J)
        return J, xi, yi

    def grid_at(self, grid, x, y):
        J, xi, yi = grid
        u = np.clip((x - xi) / CELL + HALF, 0.0, SIDE - 1.001)
        v = np.clip((y - yi) / CELL + HALF, 0.0, SIDE - 1.001)
        iu = u.astype(np.int64)
        iv = v.astype(np.int64)
        fu = u - iu
        fv = v - iv
        a = J[iv, iu] * (1 - fu) + J[iv, iu + 1] * fu
        b = J[iv + 1, iu] * (1 - fu) + J[iv + 1, iu + 1] * fu
        return a * (1 - fv) + b * fv

    # ---------------------------------------------------------------- roll-outs
    def rollout(self, C, x0, y0, th0, gm, table):
        n = len(C)
        tx, ty = table
        x = np.full(n, x0)
        y = np.full(n, y0)
        th = np.full(n, th0)
        c = self.clear_at(x, y)
        X = np.empty((NR, n))
        Y = np.empty((NR, n))
        w0 = v0 = None
        t1 = C[:, 4]
        tm = TURN * gm
        for k in range(NR):
            m1 = (t1 > TBEG[k] + 1e-6)[:, None]
            S = np.where(m1, C[:, 0:4], C[:, 5:9])
            i2 = (y * 0.5 + 2.5).astype(np.int64) * self.w2 + (x * 0.5 + 2.5).astype(np.int64)
            fx = tx[i2] - x
            fy = ty[i2] - y
            fn = S[:, 2] / (np.hypot(fx, fy) + 1e-6)
            dx = S[:, 0] + fx * fn
            dy = S[:, 1] + fy * fn
            i = self.near_index(x, y)
            gx = self.gx[i]
            gy = self.gy[i]
            rem = np.minimum(dx * gx + dy * gy, 0.0) * np.clip((11.0 - c) * 0.45, 0.0, 1.0)
            dx = dx - rem * gx
            dy = dy - rem * gy
            sp = S[:, 3] * np.minimum(1.0, np.hypot(dx, dy))
            e = np.arctan2(dy, dx) - th
            e = (e + PI) % (2.0 * PI) - PI
            rev = np.abs(e) > PI / 2
            e = np.where(rev, e - np.copysign(PI, e), e)
            # small errors gently: turning costs speed
            e = e * np.clip(np.abs(e) * 8.0, 0.35, 1.0)
            w = np.where(sp > 0.02, np.clip(0.9 * e / tm, -1.0, 1.0), 0.0)
            v = np.minimum(sp, 1.0 - np.abs(w))
            v = np.where(rev, -v, v)
            turn = w * tm
            mid = th + turn * 0.5
            s = v * (STEP * gm)
            xn = x + s * np.cos(mid)
            yn = y + s * np.sin(mid)
            cn = self.clear_at(xn, yn)
            ok = (cn >= WALL) | (cn > c)
            th = th + turn
            x = np.where(ok, xn, x)
            y = np.where(ok, yn, y)
            c = np.where(ok, cn, c)
            if k == 0:
                w0 = w
                v0 = np.where(ok, v, 0.0)
            X[k] = x
            Y[k] = y
        return X, Y, w0, v0

    def act(self, obs):
        if self.t0 is None:
            self.t0 = time.process_time()
        x, y, th = (float(a) for a in obs["pose"])
        ranges = np.asarray(obs["ranges"], dtype=float)
        self.estimate_gains(x, y, th)
        self.track(x, y, th, ranges)
        used = time.process_time() - self.t0
        tight = used > 1.0 + 0.016 * self.n
        pred = self.predict_tracks(x, y, 6 if tight else 12)
        gm = min(1.0, self.gl, self.gr)

        here = float(self.value_at(np.array([x]), np.array([y]))[0])
        if here < self.best_v - 3.0:
            self.best_v = here
            self.best_n = self.n
        lonely = all(math.hypot(t.x - x, t.y - y) > 60.0 for t in self.tracks)
        if lonely and self.n - self.best_n > 40:
            # no progress although nobody is near: follow the field more closely
            self.short_until = self.n + 40
            self.best_n = self.n
            self.best_v = here
        table = self.targets[1] if self.n < self.short_until else self.targets[0]

        a = th + self.dyn_offs
        rows = slice(self.dyn, self.dyn + len(a))
        self.cands[rows, 0] = np.cos(a)
        self.cands[rows, 1] = np.sin(a)
        if self.prev is not None:
            row = self.prev.copy()
            row[4] -= 0.1
            self.cands[-1] = row
        C = self.cands[self.small] if tight else self.cands
        grid = self.grid_values(x, y, pred)
        X, Y, w0, v0 = self.rollout(C, x, y, th, gm, table)
        n = len(C)

        gx, gy = self.goal
        done = np.zeros((NR, n), dtype=bool)
        if math.hypot(gx - x, gy - y) < 40.0:
            done = np.maximum.accumulate(np.hypot(X - gx, Y - gy) < 3.7, axis=0)
        cost = np.where(done[-1], -10.0, self.grid_at(grid, X[-1], Y[-1]))
        for k in (3, NR - 1):
            cost = cost + 0.04 * np.where(done[k], 0.0, self.value_at(X[k], Y[k]))
        # earlier arrivals count more
        cost = cost - 2.0 * done.sum(axis=0)
        if pred is not None:
            PX, PY, rad, alt = pred
            gap = np.full((NR, n), 99.0)
            other = np.full((NR, n), 99.0)
            for m in range(len(rad)):
                if math.hypot(PX[m, 0] - x, PY[m, 0] - y) > 80.0:
                    continue
                reach = BODY + rad[m]
                d = np.hypot(X - PX[m, :NR, None], Y - PY[m, :NR, None]) - reach
                gap = np.minimum(gap, d)
                for ax, ay in alt:
                    d = np.hypot(X - ax[m][:, None], Y - ay[m][:, None]) - reach
                    other = np.minimum(other, d)
            gap[1:] = np.where(done[:-1], 99.0, gap[1:])
            other[1:] = np.where(done[:-1], 99.0, other[1:])
            over = R_CONT[:, None] - gap
            sev = np.where(over > 0.0, 0.8 + 0.15 * np.clip(over, 0.0, 6.0), 0.0) * R_HARD[:, None]
            soft = np.clip(1.0 - gap / R_MARG[:, None], 0.0, 1.3) ** 2
            alt_sev = np.where(other < 0.1, 0.08, 0.0) * R_HARD[:, None]
            cost = cost + 0.8 * sev.max(axis=0) + 0.2 * sev.sum(axis=0)
            cost = cost + (soft * R_SOFT[:, None]).sum(axis=0) + alt_sev.max(axis=0)
        if self.prev is not None:
            cost[-1] -= 2.0
        b = int(np.argmin(cost))
        self.prev = C[b].copy()
        w = float(w0[b])
        v = float(v0[b])
        left = (v + w) * gm / self.gl
        right = (v - w) * gm / self.gr
        left = max(-1.0, min(1.0, left))
        right = max(-1.0, min(1.0, right))
        self.last = (x, y, th, left, right)
        self.n += 1
        return left, right


STATE = {}


def reset(obs):
    STATE["c"] = Controller(obs)


def policy(obs):
    if "c" not in STATE:
        reset(obs)
    left, right = STATE["c"].act(obs)
    if not (math.isfinite(left) and math.isfinite(right)):
        return 0.0, 0.0
    return float(left), float(right)
