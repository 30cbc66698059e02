import math
import heapq
import time
import numpy as np

N = 960
OFF = 480
NR = 72
DT = 0.1
RANGE = 120.0
HORIZON = 26
BLOCK = 1e9
RAY = np.deg2rad(-177.5 + 5.0 * np.arange(NR))
DIST = np.arange(0.3, 120.0, 0.8)
TWO_PI = 2.0 * math.pi


def wrap(a):
    return (a + math.pi) % TWO_PI - math.pi


def build_candidates(nd, few):
    rows = []  # rel. direction, k1, s1, type1, type2; types: 0 direction, 1 wait, 2 path, 3 trail
    for i in range(nd):
        rel = TWO_PI * i / nd
        for k in ((4, 10) if few else (3, 7, 13)):
            rows.append((rel, k, 1.0, 0, 2))
            rows.append((rel, k, 1.0, 0, 1))
        rows.append((rel, 99, 1.0, 0, 1))
        if not few:
            rows.append((rel, 5, 0.5, 0, 2))
        rows.append((rel, 12, 0.5, 0, 2))
    for s in (1.0, 0.8, 0.6, 0.4, 0.2):
        rows.append((0.0, 99, s, 2, 2))
        rows.append((0.0, 8, s, 2, 2))
        rows.append((0.0, 5, s, 2, 1))
        rows.append((0.0, 12, s, 2, 1))
    for k in (1, 2, 4, 7, 11, 16, 99):
        rows.append((0.0, k, 0.0, 1, 2))
    for k in (5, 10, 16):
        rows.append((0.0, k, 1.0, 3, 2))
        rows.append((0.0, k, 1.0, 3, 1))
    rows.append((0.0, 99, 1.0, 3, 1))
    return np.array(rows, dtype=np.float64)


CAND_FULL = build_candidates(20, False)
CAND_FEW = build_candidates(12, True)


def edt2(occ, rad=18):
    b = np.where(occ, 0, 900).astype(np.int16)
    g = b.copy()
    for k in range(1, rad + 1):
        kk = np.int16(k * k)
        np.minimum(g[k:], b[:-k] + kk, out=g[k:])
        np.minimum(g[:-k], b[k:] + kk, out=g[:-k])
    o = g.copy()
    for k in range(1, rad + 1):
        kk = np.int16(k * k)
        np.minimum(o[:, k:], g[:, :-k] + kk, out=o[:, k:])
        np.minimum(o[:, :-k], g[:, k:] + kk, out=o[:, :-k])
    return np.minimum(o, (rad + 1) * (rad + 1))


def dijkstra(cost, width, goal, robot, extra):
    n = len(cost)
    g = [1e8] * n
    par = [-1] * n
    g[goal] = 0.0
    heap = [(0.0, goal)]
    r1 = 4.0
    r2 = 4.0 * 1.41421356
    moves = ((-width, r1), (width, r1), (-1, r1), (1, r1),
             (-width - 1, r2), (-width + 1, r2), (width - 1, r2), (width + 1, r2))
    pop = heapq.heappop
    push = heapq.heappush
    limit = 1e8
    while heap:
        gu, u = pop(heap)
        if gu > g[u]:
            continue
        if gu > limit:
            break
        if u == robot:
            limit = gu + extra
        for dv, ln in moves:
            v = u + dv
            ng = gu + ln * cost[v]
            if ng < g[v]:
                g[v] = ng
                par[v] = u
                push(heap, (ng, v))
    return g, par


def find_lattice(p):
    """Axis angle and offsets of the pixel lattice from exact hits, or None."""
    n = len(p)
    if n < 16:
        return None
    if n > 90:
        p = p[:: (n // 90 + 1)]
        n = len(p)
    ii, jj = np.triu_indices(n, 1)
    d = p[jj] - p[ii]
    ln = np.hypot(d[:, 0], d[:, 1])
    ok = ln > 2.5
    ii, jj, d = ii[ok], jj[ok], d[ok]
    if len(ii) == 0:
        return None
    a = np.arctan2(d[:, 1], d[:, 0])
    c, s = np.cos(a), np.sin(a)
    v = -s[:, None] * p[:, 0] + c[:, None] * p[:, 1]
    v0 = -s * p[ii, 0] + c * p[ii, 1]
    e = v - v0[:, None]
    e -= np.round(e)
    cnt = (np.abs(e) < 0.003).sum(1)
    b = int(cnt.argmax())
    if cnt[b] < 7:
        return None
    ang = float(a[b])
    x, y = p[:, 0], p[:, 1]
    ov = float(v0[b]) - 0.5
    u = math.cos(ang) * x + math.sin(ang) * y
    du = u[:, None] - u[None, :]
    du -= np.round(du)
    free = np.abs(e[b]) >= 0.003
    if free.any():
        cu = ((np.abs(du) < 0.004) & free[:, None] & free[None, :]).sum(1)
    else:
        cu = (np.abs(du) < 0.004).sum(1)
    ou = float(u[int(cu.argmax())]) - 0.5
    tol = 0.006
    total = 0
    for _ in range(4):
        c0, s0 = math.cos(ang), math.sin(ang)
        u = c0 * x + s0 * y
        v = -s0 * x + c0 * y
        eu = u - ou - 0.5
        eu = eu - np.round(eu)
        ev = v - ov - 0.5
        ev = ev - np.round(ev)
        mu = np.abs(eu) < tol
        mv = np.abs(ev) < tol
        total = int((mu | mv).sum())
        if mu.sum() < 2 or mv.sum() < 2:
            return None
        A = np.zeros((int(mu.sum() + mv.sum()), 3))
        k = int(mu.sum())
        A[:k, 0] = v[mu]
        A[:k, 1] = -1.0
        A[k:, 0] = -u[mv]
        A[k:, 2] = -1.0
        rhs = -np.concatenate([eu[mu], ev[mv]])
        sol = np.linalg.lstsq(A, rhs, rcond=None)[0]
        ang += float(sol[0])
        ou += float(sol[1])
        ov += float(sol[2])
        tol = 0.003
    if total < max(13, 0.5 * n):
        return None
    return ang, ou, ov


def fit_circle(p):
    m = p.mean(0)
    q = p - m
    A = np.stack([2 * q[:, 0], 2 * q[:, 1], np.ones(len(q))], 1)
    b = (q ** 2).sum(1)
    M = A.T @ A
    if abs(np.linalg.det(M)) < 1e-9:
        return None
    sol = np.linalg.solve(M, A.T @ b)
    r2 = sol[2] + sol[0] ** 2 + sol[1] ** 2
    if r2 <= 0:
        return None
    r = math.sqrt(r2)
    c = sol[:2]
    res = float(np.abs(np.hypot(q[:, 0] - c[0], q[:, 1] - c[1]) - r).max())
    return c + m, r, res


def solve_motion(hist, n, c, v, r, r_fixed):
    """Centre now, velocity and radius of a disc from the points of several scans."""
    P = np.concatenate([h[1] for h in hist], 0)
    tau = np.concatenate([np.full(len(h[1]), (h[0] - n) * DT) for h in hist])
    s = np.array([c[0], c[1], v[0], v[1], r], dtype=np.float64)
    e = None
    for _ in range(9):
        dx = P[:, 0] - s[0] - s[2] * tau
        dy = P[:, 1] - s[1] - s[3] * tau
        d = np.sqrt(dx * dx + dy * dy) + 1e-9
        e = d - s[4]
        if np.abs(e).max() < 1e-3:
            break
        ux, uy = -dx / d, -dy / d
        J = np.stack([ux, uy, ux * tau, uy * tau, -np.ones(len(P))], 1)
        if r_fixed:
            J[:, 4] = 0.0
        A = J.T @ J + np.diag([1e-7, 1e-7, 1e-8, 1e-8, 1e-7])
        st = np.linalg.solve(A, -(J.T @ e))
        big = max(abs(st[0]), abs(st[1]), abs(st[4]), 0.1 * abs(st[2]), 0.1 * abs(st[3]))
        if big > 4.0:
            st = st * (4.0 / big)
        s = s + st
    if e is None or not np.all(np.isfinite(s)) or float(np.abs(e).max()) > 0.02:
        return None
    sp = math.hypot(s[2], s[3])
    if not 8.0 < sp < 31.0 or not 4.8 < s[4] < 9.2:
        return None
    return s[:2].copy(), s[2:4].copy(), float(s[4]), sp


class Track:
    def __init__(self, c, r, strong, pts, n):
        self.c = np.array(c, dtype=np.float64)
        self.v = None
        self.r = float(r)
        self.rknown = bool(strong)
        self.strong = bool(strong)   # the last centre is exact
        self.exact = False           # the velocity is exact
        self.speed = None
        self.unseen = 0
        self.age = 0
        self.pred = self.c.copy()
        self.line = self.c.copy()
        self.pv = np.zeros(2)
        self.hit_wall = False
        self.hist = [(n, pts)]


class Controller:
    def __init__(self, obs):
        self.n = 0
        self.lat = None
        self.exact = False
        self.tries = 0
        self.raw = []
        self.badlat = 0
        self.best_v = 1e9
        self.best_n = 0
        self.last_vr = 1e9
        self.init_map()
        self.try_lattice(obs)

    def init_map(self):
        self.G = np.zeros((N, N), np.uint8)
        self.Gf = self.G.reshape(-1)
        self.bb = None
        self.tracks = []
        self.D = None
        self.path = None
        self.next_plan = 0
        self.trail = []
        self.prev = None

    def scan_points(self, obs):
        pose = np.asarray(obs["pose"], dtype=np.float64).ravel()
        r = np.asarray(obs["ranges"], dtype=np.float64).ravel()
        a = pose[2] + RAY
        h = r < RANGE - 0.01
        return np.stack([pose[0] + r * np.cos(a), pose[1] + r * np.sin(a)], 1)[h]

    def try_lattice(self, obs):
        self.tries += 1
        self.raw.append(self.scan_points(obs))
        if len(self.raw) > 2:
            self.raw.pop(0)
        lat = find_lattice(self.raw[-1])
        if lat is None and len(self.raw) > 1:
            lat = find_lattice(np.concatenate(self.raw, 0))
        if lat is not None:
            self.lat = lat
            self.exact = True
            self.init_map()
        elif self.lat is None:
            self.lat = (0.0, 0.0, 0.0)

    def to_grid(self, x, y):
        a, ou, ov = self.lat
        c, s = math.cos(a), math.sin(a)
        return c * x + s * y - ou, -s * x + c * y - ov

    # ------------------------------------------------------------ map
    def update_map(self, x, y, th, r):
        ang = th + RAY
        ca, sa = np.cos(ang), np.sin(ang)
        hit = r < RANGE - 0.01
        hu = x + r * ca
        hv = y + r * sa
        iu = np.clip(np.round(hu).astype(np.int64) + OFF, 2, N - 3)
        iv = np.clip(np.round(hv).astype(np.int64) + OFF, 2, N - 3)
        allfree = np.ones(NR, bool)
        if not self.exact:
            for a in (-1, 0, 1):
                for b in (-1, 0, 1):
                    allfree &= self.G[iu + a, iv + b] == 1
        lim = r - (0.05 if self.exact else 1.2)
        ri, ki = np.nonzero(DIST[None, :] < lim[:, None])
        dd = DIST[ki]
        fu = np.clip(np.round(x + dd * ca[ri]).astype(np.int64) + OFF, 1, N - 2)
        fv = np.clip(np.round(y + dd * sa[ri]).astype(np.int64) + OFF, 1, N - 2)
        self.Gf[fu * N + fv] = 1
        if self.exact:
            eu = np.abs(hu - np.floor(hu) - 0.5) < 0.002
            ev = np.abs(hv - np.floor(hv) - 0.5) < 0.002
            latt = (eu | ev) & hit
            pu = np.where(eu, hu + 0.1 * np.sign(ca), hu)
            pv = np.where(ev, hv + 0.1 * np.sign(sa), hv)
            iu = np.clip(np.round(pu).astype(np.int64) + OFF, 1, N - 2)
            iv = np.clip(np.round(pv).astype(np.int64) + OFF, 1, N - 2)
            state = self.G[iu, iv]
            isfree = state == 1
            mover = hit & ~latt
            nb = np.roll(mover, 1) | np.roll(mover, -1)
            for tr in self.tracks:
                if tr.exact:
                    e = np.abs(np.hypot(hu - tr.pred[0], hv - tr.pred[1]) - tr.r)
                    mover = mover | (hit & (e < 0.02) & ~(latt & (state == 2)))
            mover = mover | (latt & isfree & nb)
            wall = latt & ~isfree & ~mover
            nh = int(hit.sum())
            if nh > 15 and latt.sum() < 0.35 * nh:
                self.badlat += 1
            else:
                self.badlat = max(0, self.badlat - 1)
        else:
            mover = hit & allfree
            wall = hit & ~mover
        self.G[iu[wall], iv[wall]] = 2
        xs, ys = hu[wall], hv[wall]
        if self.bb is None:
            self.bb = [x, x, y, y]
        bb = self.bb
        if xs.size:
            bb[0] = min(bb[0], float(xs.min()))
            bb[1] = max(bb[1], float(xs.max()))
            bb[2] = min(bb[2], float(ys.min()))
            bb[3] = max(bb[3], float(ys.max()))
        near = hit & ~mover & (r < 40.0)
        self.wp = (hu[near], hv[near])
        mi = np.nonzero(mover)[0]
        return mi, np.stack([hu[mi], hv[mi]], 1)

    def dlook(self, px, py):
        i = np.clip(np.round(px).astype(np.int64) + OFF - self.ox, 2, self.D.shape[0] - 3)
        j = np.clip(np.round(py).astype(np.int64) + OFF - self.oy, 2, self.D.shape[1] - 3)
        return i, j

    # ------------------------------------------------------------ movers
    def advance(self, c, v, r):
        """One step of all discs: arrays (M,2), (M,2), (M,). Reflects off known walls."""
        c2 = c + v * DT
        b = np.zeros(len(c), bool)
        if self.D is not None and len(c):
            i, j = self.dlook(c2[:, 0], c2[:, 1])
            D = self.D
            low = D[i, j] < r + 0.4
            if low.any():
                gx = D[i + 2, j] - D[i - 2, j]
                gy = D[i, j + 2] - D[i, j - 2]
                gl = np.hypot(gx, gy)
                ok = low & (gl > 0.3)
                gl = np.maximum(gl, 1e-6)
                gx, gy = gx / gl, gy / gl
                vn = v[:, 0] * gx + v[:, 1] * gy
                b = ok & (vn < 0)
                if b.any():
                    v = v.copy()
                    v[b, 0] -= 2 * vn[b] * gx[b]
                    v[b, 1] -= 2 * vn[b] * gy[b]
                    c2 = c2.copy()
                    pen = np.clip(r + 0.5 - D[i, j], 0.0, 3.0)
                    c2[b, 0] += (pen * gx)[b]
                    c2[b, 1] += (pen * gy)[b]
        return c2, v, b

    def predict_tracks(self):
        if not self.tracks:
            return
        c = np.array([t.c for t in self.tracks])
        v = np.array([t.v if t.v is not None else (0.0, 0.0) for t in self.tracks])
        r = np.array([t.r for t in self.tracks])
        c2, v2, b = self.advance(c, v, r)
        for k, t in enumerate(self.tracks):
            t.pred = c2[k].copy()
            t.line = c[k] + v[k] * DT
            t.pv = v2[k].copy()
            t.hit_wall = bool(b[k])

    def detections(self, mi, mp, rx, ry):
        out = []
        m = len(mi)
        if m == 0:
            return out
        gaps = (np.roll(mi, -1) - mi) % NR
        if m == 1:
            gaps = np.array([NR])
        st = (int(gaps.argmax()) + 1) % m
        order = [(st + k) % m for k in range(m)]
        groups = [[order[0]]]
        for a, b in zip(order[:-1], order[1:]):
            g = (mi[b] - mi[a]) % NR
            if g <= 2 and math.hypot(mp[b][0] - mp[a][0], mp[b][1] - mp[a][1]) < 13.0:
                groups[-1].append(b)
            else:
                groups.append([b])
        for grp in groups:
            pts = mp[grp]
            left = list(range(len(grp)))
            while len(left) >= 3:
                best = None
                tests = [left] + [left[k:k + 3] for k in range(len(left) - 2)]
                for sub in tests:
                    f = fit_circle(pts[sub])
                    if f is None or f[2] > 0.05 or not 4.8 < f[1] < 9.2:
                        continue
                    mm = pts[sub].mean(0)
                    far = math.hypot(f[0][0] - rx, f[0][1] - ry) - math.hypot(mm[0] - rx, mm[1] - ry)
                    if far < 0:
                        continue
                    e = np.abs(np.hypot(pts[left, 0] - f[0][0], pts[left, 1] - f[0][1]) - f[1])
                    cnt = int((e < 0.05).sum())
                    if best is None or cnt > best[0]:
                        best = (cnt, f, e)
                    if cnt == len(left):
                        break
                if best is None:
                    break
                on = [k for k, e in zip(left, best[2]) if e < 0.05]
                out.append((best[1][0], best[1][1], True, best[0], pts[on]))
                left = [k for k, e in zip(left, best[2]) if e >= 0.05]
            if left:
                out.append((None, None, False, len(left), pts[left]))
        return out

    def weak_centre(self, pts, r, me, guess=None):
        if len(pts) >= 2:
            a, b = pts[0], pts[-1]
            d = b - a
            ln = math.hypot(d[0], d[1])
            if 0.2 < ln < 2 * r:
                h = math.sqrt(max(0.0, r * r - 0.25 * ln * ln))
                nrm = np.array([-d[1], d[0]]) / ln
                mid = 0.5 * (a + b)
                if float(np.dot(nrm, mid - me)) < 0:
                    nrm = -nrm
                return mid + h * nrm
        p = pts.mean(0)
        d = (guess - p) if guess is not None else (p - me)
        ln = math.hypot(d[0], d[1])
        if ln < 1e-6:
            d = p - me
            ln = max(1e-6, math.hypot(d[0], d[1]))
        return p + d * (r / ln)

    def track(self, mi, mp, x, y, th, r):
        me = np.array([x, y])
        used = np.zeros(len(mi), bool)
        done = set()
        for k, t in enumerate(self.tracks):
            t.age += 1
            if not t.exact or len(mi) == 0:
                continue
            for c, v in ((t.line, t.v), (t.pred, t.pv)):
                e = np.abs(np.hypot(mp[:, 0] - c[0], mp[:, 1] - c[1]) - t.r)
                sel = e < 0.06
                if sel.any():
                    used |= sel
                    t.c = np.array(c)
                    t.v = np.array(v)
                    t.unseen = 0
                    t.strong = True
                    t.hist = [(self.n, mp[sel])]
                    done.add(k)
                    break
        det = self.detections(mi[~used], mp[~used], x, y)
        det.sort(key=lambda q: (not q[2], -q[3]))
        fresh = []
        solves = 0
        for c, rad, strong, cnt, pts in det:
            best, bd, bc = None, 1e9, None
            for k, t in enumerate(self.tracks):
                if k in done:
                    continue
                if strong and t.rknown and abs(t.r - rad) > 0.3:
                    continue
                cc = c if strong else self.weak_centre(pts, t.r, me, t.pred)
                dd = min(math.hypot(cc[0] - t.pred[0], cc[1] - t.pred[1]),
                         math.hypot(cc[0] - t.c[0], cc[1] - t.c[1]))
                lim = 9.0 if t.unseen == 0 else min(20.0, 9.0 + 1.0 * t.unseen)
                if dd < lim and dd < bd:
                    best, bd, bc = k, dd, cc
            if best is None:
                if strong:
                    fresh.append(Track(c, rad, True, pts, self.n))
                else:
                    cc = self.weak_centre(pts, 7.5, me)
                    if math.hypot(cc[0] - x, cc[1] - y) < 100.0 or cnt >= 2:
                        near = any(math.hypot(cc[0] - t.c[0], cc[1] - t.c[1]) < 3.0 for t in self.tracks)
                        if not near:
                            fresh.append(Track(cc, 7.5, False, pts, self.n))
                continue
            t = self.tracks[best]
            done.add(best)
            if t.exact:
                t.hist = []          # a bounce: older points are of another line
            t.hist.append((self.n, pts))
            t.hist = t.hist[-7:]
            vn = (bc - t.c) / DT
            if t.unseen > 0:
                vn = vn / (1.0 + t.unseen)
            sp = math.hypot(vn[0], vn[1])
            if strong:
                was = t.strong and t.unseen == 0 and t.rknown
                if t.exact and t.speed is not None:
                    if was and abs(sp - t.speed) < 0.2 + 0.01 * t.speed:
                        t.v = vn
                    else:
                        base = t.pv if t.hit_wall else vn
                        bl = max(1e-6, math.hypot(base[0], base[1]))
                        t.v = np.array(base) * (t.speed / bl)
                        t.exact = t.hit_wall
                elif was and 7.5 < sp < 31.5 and (t.speed is None or abs(sp - t.speed) < 0.5):
                    t.v = vn
                    t.speed = sp
                    t.exact = True
                elif t.v is None or not t.hit_wall:
                    if sp > 30.0:
                        vn = vn * (30.0 / sp)
                    t.v = vn if t.v is None else 0.5 * t.v + 0.5 * vn
                else:
                    t.v = np.array(t.pv)
                t.c = np.array(c)
                t.r = float(rad)
                t.rknown = True
                t.strong = True
            else:
                if sp > 30.0:
                    vn = vn * (30.0 / sp)
                if t.v is None:
                    t.v = vn
                elif t.exact or t.speed is not None:
                    off = math.hypot(bc[0] - t.pred[0], bc[1] - t.pred[1])
                    base = t.pv
                    if off > 1.5 and not t.hit_wall:
                        base = 0.5 * t.pv + 0.5 * vn
                    bl = max(1e-6, math.hypot(base[0], base[1]))
                    t.v = np.array(base) * (t.speed / bl) if t.speed is not None else np.array(base)
                else:
                    t.v = 0.6 * t.v + 0.4 * vn
                t.c = np.array(bc)
                t.strong = False
                t.exact = False
            t.unseen = 0
            npts = sum(len(h[1]) for h in t.hist)
            need = 5 if t.rknown else 6
            if not t.exact and len(t.hist) >= 3 and npts >= need and solves < 4:
                solves += 1
                sol = solve_motion(t.hist, self.n, t.c, t.v, t.r, t.rknown)
                if sol is None and len(t.hist) > 3 and npts > 7:
                    t.hist = t.hist[-3:]
                elif sol is not None:
                    t.c, t.v, t.r, t.speed = sol
                    t.rknown = True
                    t.strong = True
                    t.exact = True
        keep = []
        ca, sa = np.cos(th + RAY), np.sin(th + RAY)
        for k, t in enumerate(self.tracks):
            if k not in done:
                t.c = np.array(t.pred)
                if t.v is not None:
                    t.v = np.array(t.pv)
                t.unseen += 1
                t.strong = t.exact and not t.hit_wall
                t.hist = []
                dx, dy = t.c[0] - x, t.c[1] - y
                al = dx * ca + dy * sa
                pe = np.abs(dx * sa - dy * ca)
                inside = (pe < t.r - 0.7) & (al > 0)
                ent = al - np.sqrt(np.maximum(0.0, t.r * t.r - pe * pe))
                seen_through = bool((inside & (r > ent + 1.0)).any())
                if seen_through and (t.unseen >= 2 or not t.exact):
                    continue
                if t.unseen > (45 if t.speed is not None else 8):
                    continue
            keep.append(t)
        self.tracks = keep + fresh

    def forecast(self, steps):
        M = len(self.tracks)
        if M == 0:
            return None
        c = np.array([t.c for t in self.tracks])
        v = np.array([t.v if t.v is not None else (0.0, 0.0) for t in self.tracks])
        r = np.array([t.r for t in self.tracks])
        none = np.array([t.v is None for t in self.tracks])
        sure = np.array([t.exact for t in self.tracks])
        uns = np.array([t.unseen for t in self.tracks], dtype=np.float64)
        rad = r + 8.0 + np.where(np.array([t.rknown for t in self.tracks]), 0.0, 1.0)
        PC = np.zeros((steps, M, 2))
        MG = np.zeros((steps, M))
        bt = np.zeros(M)
        for t in range(steps):
            c, v, b = self.advance(c, v, r)
            bt = np.where((bt > 0) | b, bt + 1.0, 0.0)
            PC[t] = c
            grow = np.where(sure, 0.01 * t, 0.4 + 0.1 * t)
            grow = np.where(none, 1.0 + np.minimum(2.0 * t, 5.0), grow)
            MG[t] = grow + np.minimum(2.5, 0.2 * bt) + np.minimum(2.0, 0.15 * uns) + rad
        return PC, MG

    # ------------------------------------------------------------ plan
    def plan(self, x, y):
        tx, ty = self.goal
        bb = self.bb
        bb[0] = min(bb[0], x, tx)
        bb[1] = max(bb[1], x, tx)
        bb[2] = min(bb[2], y, ty)
        bb[3] = max(bb[3], y, ty)
        x0 = max(2, int(math.floor(bb[0])) - 30 + OFF)
        x1 = min(N - 2, int(math.ceil(bb[1])) + 30 + OFF)
        y0 = max(2, int(math.floor(bb[2])) - 30 + OFF)
        y1 = min(N - 2, int(math.ceil(bb[3])) + 30 + OFF)
        x1 -= (x1 - x0) % 4
        y1 -= (y1 - y0) % 4
        h, w = (x1 - x0) // 4, (y1 - y0) // 4
        crop = self.G[x0:x1, y0:y1]
        D = np.sqrt(edt2(crop == 2).astype(np.float32))
        if not self.exact:
            D = D - 0.5
        self.D = D
        self.ox, self.oy = x0, y0
        blk = D.reshape(h, 4, w, 4).transpose(0, 2, 1, 3).reshape(h, w, 16)
        arg = blk.argmax(2).ravel()
        dm = blk.max(2)
        known = (crop.reshape(h, 4, w, 4) > 0).any(axis=(1, 3))
        gx = (x0 - OFF + 1.5 + 4.0 * np.arange(h))[:, None]
        gy = (y0 - OFF + 1.5 + 4.0 * np.arange(w))[None, :]
        base = (1.0 + 0.05 * np.maximum(17.0 - dm, 0.0)
                + 0.45 * np.maximum(11.5 - dm, 0.0)).astype(np.float64)
        base[~known] *= 1.08
        si = min(h - 2, max(1, int((x + OFF + 0.5 - x0) // 4)))
        sj = min(w - 2, max(1, int((y + OFF + 0.5 - y0) // 4)))
        gi = min(h - 2, max(1, int((tx + OFF + 0.5 - x0) // 4)))
        gj = min(w - 2, max(1, int((ty + OFF + 0.5 - y0) // 4)))
        nr = ((gx - x) ** 2 + (gy - y) ** 2) < 36.0
        ng = ((gx - tx) ** 2 + (gy - ty) ** 2) < 36.0
        start, goal = si * w + sj, gi * w + gj
        g, par, cost = None, None, base
        for thr in (9.7, 8.8, 5.5):
            cost = base.copy()
            cost[dm < thr] = BLOCK
            cost[nr] = np.minimum(cost[nr], 4.0)
            cost[ng] = np.minimum(cost[ng], 4.0)
            cost[0, :] = BLOCK
            cost[-1, :] = BLOCK
            cost[:, 0] = BLOCK
            cost[:, -1] = BLOCK
            g, par = dijkstra(cost.ravel().tolist(), w, goal, start, 130.0)
            if g[start] < 1e7:
                break
        vr = g[start]
        self.vx, self.vy = x0 - OFF + 1.5, y0 - OFF + 1.5
        if vr >= 1e7:
            self.V = np.hypot(gx - tx, gy - ty) + 0.0 * dm
            self.vr = float(math.hypot(tx - x, ty - y))
            new = np.array([[x, y], [tx, ty]])
        else:
            self.V = np.minimum(np.array(g).reshape(h, w), vr + 250.0)
            self.vr = float(vr)
            seq = [start]
            while seq[-1] != goal and par[seq[-1]] >= 0:
                seq.append(par[seq[-1]])
            ids = np.array(seq)
            a = arg[ids]
            wide = dm.ravel()[ids] > 14.0
            px = x0 - OFF + 4.0 * (ids // w) + np.where(wide, 1.5, a // 4)
            py = y0 - OFF + 4.0 * (ids % w) + np.where(wide, 1.5, a % 4)
            gs = np.array([g[k] for k in seq])
            if len(ids) == 1:
                px, py, gs = np.array([x, tx]), np.array([y, ty]), np.array([1.0, 0.0])
            px[0], py[0] = x, y
            px[-1], py[-1] = tx, ty
            keep = [0]
            i = 0
            last = len(px) - 1
            while i < last:
                nxt = i + 1
                for jump in (45, 34, 26, 20, 15, 11, 8, 6, 4, 3, 2):
                    j = i + jump
                    if j > last:
                        if i + jump * 0.7 > last:
                            continue
                        j = last
                    ln = math.hypot(px[j] - px[i], py[j] - py[i])
                    m = max(2, int(ln / 2.5) + 1)
                    tt = (np.arange(m) + 0.5) / m
                    ci = np.clip(((px[i] + (px[j] - px[i]) * tt + OFF + 0.5 - x0) // 4).astype(np.int64), 0, h - 1)
                    cj = np.clip(((py[i] + (py[j] - py[i]) * tt + OFF + 0.5 - y0) // 4).astype(np.int64), 0, w - 1)
                    if float(cost[ci, cj].mean()) * ln <= (gs[i] - gs[j]) * 1.01:
                        nxt = j
                        break
                keep.append(nxt)
                i = nxt
            new = np.stack([px[keep], py[keep]], 1)
        seg = np.hypot(np.diff(new[:, 0]), np.diff(new[:, 1]))
        ok = np.concatenate(([True], seg > 1e-6))
        new = new[ok]
        if len(new) < 2:
            new = np.array([[x, y], [tx + 1e-3, ty]])
        seg = np.hypot(np.diff(new[:, 0]), np.diff(new[:, 1]))
        cum = np.concatenate(([0.0], np.cumsum(seg)))
        m = max(1, int(round(cum[-1] / 3.0)))
        tt = np.linspace(0.0, cum[-1], m + 1)
        self.path = np.stack([np.interp(tt, cum, new[:, 0]), np.interp(tt, cum, new[:, 1])], 1)
        # directions to the path and along the trail, for cells around the robot
        self.fx, self.fy = x - 108.0, y - 108.0
        cx = (self.fx + 2.0 + 4.0 * np.arange(54))[:, None] + np.zeros((1, 54))
        cy = (self.fy + 2.0 + 4.0 * np.arange(54))[None, :] + np.zeros((54, 1))
        self.DP = self.direction_field(cx.ravel(), cy.ravel(), self.path[:45], 4).reshape(54, 54)
        if len(self.trail) > 1:
            tr = np.array(self.trail[::-1][:40])
            self.DTR = self.direction_field(cx.ravel(), cy.ravel(), tr, 4).reshape(54, 54)
        else:
            self.DTR = self.DP + math.pi

    def direction_field(self, cx, cy, pts, ahead):
        d2 = (cx[:, None] - pts[None, :, 0]) ** 2 + (cy[:, None] - pts[None, :, 1]) ** 2
        j = np.minimum(d2.argmin(1) + ahead, len(pts) - 1)
        return np.arctan2(pts[j, 1] - cy, pts[j, 0] - cx)

    def value(self, px, py):
        V = self.V
        h, w = V.shape
        i0 = np.round((px - self.vx) / 4.0).astype(np.int64)
        j0 = np.round((py - self.vy) / 4.0).astype(np.int64)
        best = np.full(px.shape, 1e9)
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                i = np.clip(i0 + a, 0, h - 1)
                j = np.clip(j0 + b, 0, w - 1)
                d = np.hypot(px - (self.vx + 4.0 * i), py - (self.vy + 4.0 * j))
                best = np.minimum(best, V[i, j] + 1.15 * d)
        return best

    # ------------------------------------------------------------ choice
    def choose(self, x, y, th, slack):
        T = HORIZON if slack > 0.5 else 20
        cand = CAND_FULL if slack > 0.9 else CAND_FEW
        fc = self.forecast(T)
        p = self.path
        d2 = (p[:45, 0] - x) ** 2 + (p[:45, 1] - y) ** 2
        k = min(int(d2.argmin()) + 4, len(p) - 1)
        psi0 = math.atan2(p[k, 1] - y, p[k, 0] - x)
        phi = psi0 + cand[:, 0]
        k1 = cand[:, 1]
        s1 = cand[:, 2]
        t1 = cand[:, 3]
        t2 = cand[:, 4]
        bonus = np.zeros(len(cand))
        if self.prev is not None:
            pr = self.prev
            phi = np.append(phi, pr[0])
            k1 = np.append(k1, pr[1])
            s1 = np.append(s1, pr[2])
            t1 = np.append(t1, pr[3])
            t2 = np.append(t2, pr[4])
            bonus = np.append(bonus, -2.5)
        n = len(phi)
        px = np.full(n, x)
        py = np.full(n, y)
        h = np.full(n, th)
        tc = np.full(n, T, dtype=np.float64)
        ta = np.full(n, T, dtype=np.float64)
        alive = np.ones(n, bool)
        arrived = np.zeros(n, bool)
        soft = np.zeros(n)
        worst = np.full(n, 50.0)
        i, j = self.dlook(np.array([x]), np.array([y]))
        dnow = float(self.D[i[0], j[0]])
        thr = max(8.5, min(9.3, dnow - 0.35))
        gnow = 50.0
        if self.tracks:
            gnow = min(math.hypot(t.c[0] - x, t.c[1] - y) - t.r - 8.0 for t in self.tracks)
        wx, wy = self.wp
        left = right = None
        gx, gy = self.goal
        for t in range(T):
            ci = np.clip(((px - self.fx) * 0.25).astype(np.int64), 0, 53)
            cj = np.clip(((py - self.fy) * 0.25).astype(np.int64), 0, 53)
            first = t < k1
            typ = np.where(first, t1, t2)
            psi = np.where(typ == 0, phi, np.where(typ == 3, self.DTR[ci, cj], self.DP[ci, cj]))
            sp = np.where(typ == 1, 0.0, np.where(first, s1, 1.0))
            err = (psi - h + math.pi) % TWO_PI - math.pi
            back = np.abs(err) > 0.5 * math.pi
            err = np.where(back, err - np.sign(err) * math.pi, err)
            turn = np.clip(err, -0.666, 0.666)
            s = 1.5 * turn
            v = np.minimum(sp, 1.0 - np.abs(s)) * np.where(back, -1.0, 1.0)
            if t == 0:
                left, right = v + s, v - s
            mid = h + 0.5 * turn
            d = 3.0 * v
            px = px + d * np.cos(mid)
            py = py + d * np.sin(mid)
            h = h + turn
            i, j = self.dlook(px, py)
            dc = self.D[i, j]
            bad = dc < thr
            if t < 3 and wx.size:
                e = np.sqrt(((px[:, None] - wx) ** 2 + (py[:, None] - wy) ** 2).min(1))
                moved = np.abs(px - x) + np.abs(py - y) > 0.05
                bad = bad | ((e < 8.35) & moved)
            act = alive & ~arrived
            if fc is not None:
                PC, MG = fc
                g = (np.sqrt((px[:, None] - PC[t, :, 0]) ** 2 + (py[:, None] - PC[t, :, 1]) ** 2) - MG[t]).min(1)
                gthr = 0.4 if t > 1 else min(0.4, max(0.05, gnow - 0.1))
                bad = bad | (g < gthr)
                wt = 1.0 if t < 12 else 0.5
                pen = np.maximum(0.0, 3.5 - g) ** 2 + 10.0 * np.maximum(0.0, 1.2 - g) ** 2
                soft += np.where(act, wt * pen, 0.0)
                worst = np.where(act, np.minimum(worst, g + 0.15 * t), worst)
            soft += np.where(act, 0.15 * np.maximum(0.0, 11.5 - dc) ** 2, 0.0)
            new = act & bad
            tc = np.where(new, t, tc)
            alive = alive & ~new
            arr = alive & ~arrived & (np.hypot(px - gx, py - gy) < 3.5)
            ta = np.where(arr, t, ta)
            arrived = arrived | arr
        J = np.where(arrived, -3.0 * (T - ta), self.value(px, py))
        J = J + self.soft_weight * soft + bonus
        J = np.where(~alive, J + 30.0 + 25.0 * (T - tc) + 8.0 * np.maximum(0.0, -worst), J)
        b = int(np.argmin(J))
        self.prev = (float(phi[b]), float(max(0.0, k1[b] - 1.0)), float(s1[b]), float(t1[b]), float(t2[b]))
        lf = max(-1.0, min(1.0, float(left[b])))
        rt = max(-1.0, min(1.0, float(right[b])))
        return lf, rt

    def act(self, obs):
        slack = 2.0 + 0.02 * self.n - time.process_time()
        if self.n > 0 and not self.exact and self.tries < 12 and slack > 0.5:
            self.try_lattice(obs)
        if self.exact and self.badlat > 8:
            self.exact = False
            self.badlat = 0
            self.tries = 99
            self.init_map()
        self.n += 1
        pose = np.asarray(obs["pose"], dtype=np.float64).ravel()
        goal = np.asarray(obs["goal"], dtype=np.float64).ravel()
        r = np.asarray(obs["ranges"], dtype=np.float64).ravel()
        x, y = self.to_grid(float(pose[0]), float(pose[1]))
        th = float(pose[2]) - self.lat[0]
        self.goal = self.to_grid(float(goal[0]), float(goal[1]))
        stalled = self.n - self.best_n
        self.soft_weight = 0.15 if stalled < 80 else (0.09 if stalled < 160 else 0.05)
        self.predict_tracks()
        mi, mp = self.update_map(x, y, th, r)
        self.track(mi, mp, x, y, th, r)
        if not self.trail or math.hypot(self.trail[-1][0] - x, self.trail[-1][1] - y) > 3.0:
            self.trail.append((x, y))
        if self.path is None or (self.n >= self.next_plan and slack > 0.3):
            t0 = time.process_time()
            self.plan(x, y)
            cpu = time.process_time() - t0
            rate = 0.010 if slack > 1.2 else 0.006
            self.next_plan = self.n + min(12, max(4, int(cpu / rate) + 1))
            if self.vr > self.last_vr + 25.0:
                self.best_v = self.vr
                self.best_n = self.n
            elif self.vr < self.best_v - 4.0:
                self.best_v = self.vr
                self.best_n = self.n
            self.last_vr = self.vr
        if self.n == 1:
            k = min(5, len(self.path) - 1)
            err = wrap(math.atan2(self.path[k, 1] - y, self.path[k, 0] - x) - th)
            if abs(err) > 0.5 * math.pi:
                err -= math.copysign(math.pi, err)
            s = max(-1.0, min(1.0, 1.5 * err))
            return s, -s
        return self.choose(x, y, th, slack)


STATE = {"c": None, "errors": 0}


def reset(obs):
    STATE["c"] = Controller(obs)


def policy(obs):
    if STATE["c"] is None:
        STATE["c"] = Controller(obs)
    c = STATE["c"]
    try:
        left, right = c.act(obs)
    except Exception:
        STATE["errors"] += 1
        c.tracks = []
        c.prev = None
        c.path = None
        left, right = 0.0, 0.0
    if not (math.isfinite(left) and math.isfinite(right)):
        left, right = 0.0, 0.0
    return float(max(-1.0, min(1.0, left))), float(max(-1.0, min(1.0, right)))
