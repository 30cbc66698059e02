import math
import heapq
import time
from collections import deque
import numpy as np

AX = 11.0
STEP = 3.0
N = 720
C0 = 360
HIT_MAX = 55.0
BLOCK = 1e9
HARD = 8.22
ANG = np.deg2rad(-90.0 + np.arange(24) * (180.0 / 23.0))
SPACING = math.radians(180.0 / 23.0)
DIST = np.arange(0.5, 56.0, 0.9)
R2 = 1.41421356

_o = np.arange(-3, 4)
_gx, _gy = np.meshgrid(_o, _o, indexing="ij")
OX = _gx.ravel().astype(np.float64)[None, :]
OY = _gy.ravel().astype(np.float64)[None, :]
OFF = (_gx.ravel() * N + _gy.ravel())[None, :]

_o = np.arange(-8, 9)
_gx, _gy = np.meshgrid(_o, _o, indexing="ij")
_in = (_gx ** 2 + _gy ** 2) <= 46
BODY = (_gx * N + _gy)[_in]


def make_candidates():
    ls, rs = [], []
    for m in (0.15, 0.3, 0.45, 0.6, 0.8, 1.0):
        for q in (1.0, 0.95, 0.9, 0.8, 0.7, 0.55, 0.4, 0.2, 0.0, -0.3):
            ls.append(m)
            rs.append(m * q)
            if q != 1.0:
                ls.append(m * q)
                rs.append(m)
    for s in (0.12, 0.25, 0.42):
        ls += [s, -s]
        rs += [-s, s]
    return np.array(ls), np.array(rs)


CL, CR = make_candidates()


def wrap(a):
    return (a + math.pi) % (2.0 * math.pi) - math.pi


def edt2(occ, rad=13):
    b = np.where(occ, 0, 400).astype(np.int16)
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
    return np.minimum(o, 196)


def occupied(sub, rel=0.2):
    """sub has a rim of one cell; the answer has none."""
    c = sub[1:-1, 1:-1]
    h, w = c.shape
    mx = c.copy()
    for a in (0, 1, 2):
        for b in (0, 1, 2):
            if a != 1 or b != 1:
                np.maximum(mx, sub[a:a + h, b:b + w], out=mx)
    return (c > 0.12) & (c >= rel * mx)


def shortest(cost, width, start, goal, hval, bound):
    """A* to goal, or (goal < 0) all cells within the bound."""
    n = len(cost)
    g = [1e8] * n
    par = [-1] * n
    done = bytearray(n)
    g[start] = 0.0
    heap = [(hval[start] if hval is not None else 0.0, start)]
    moves = ((-width, 1.0), (width, 1.0), (-1, 1.0), (1, 1.0),
             (-width - 1, R2), (-width + 1, R2), (width - 1, R2), (width + 1, R2))
    pop = heapq.heappop
    push = heapq.heappush
    while heap:
        f, u = pop(heap)
        if done[u]:
            continue
        if f > bound:
            break
        done[u] = 1
        if u == goal:
            break
        gu = g[u]
        for dv, ln in moves:
            v = u + dv
            ng = gu + ln * cost[v]
            if ng < g[v]:
                g[v] = ng
                par[v] = u
                push(heap, (ng + hval[v] if hval is not None else ng, v))
    if goal < 0:
        return g, done
    if not done[goal]:
        return None, None
    seq = [goal]
    while seq[-1] != start:
        seq.append(par[seq[-1]])
    seq.reverse()
    return seq, [g[u] for u in seq]


def resample(p, ds=2.0):
    seg = np.hypot(np.diff(p[:, 0]), np.diff(p[:, 1]))
    keep = np.concatenate(([True], seg > 1e-6))
    p = p[keep]
    if len(p) < 2:
        return p
    seg = np.hypot(np.diff(p[:, 0]), np.diff(p[:, 1]))
    cum = np.concatenate(([0.0], np.cumsum(seg)))
    m = max(1, int(round(cum[-1] / ds)))
    t = np.linspace(0.0, cum[-1], m + 1)
    return np.stack([np.interp(t, cum, p[:, 0]), np.interp(t, cum, p[:, 1])], 1)


def cells(x, y):
    ix = np.clip(np.floor(x + (C0 + 0.5)).astype(np.int64), 5, N - 6)
    iy = np.clip(np.floor(y + (C0 + 0.5)).astype(np.int64), 5, N - 6)
    return ix, iy


class HitMap:
    """Weighted mean of the hits and of their ray directions, per cell of 1 px."""

    def __init__(self):
        self.W = np.zeros(N * N, np.float32)
        self.SX = np.zeros(N * N, np.float32)
        self.SY = np.zeros(N * N, np.float32)
        self.VX = np.zeros(N * N, np.float32)
        self.VY = np.zeros(N * N, np.float32)
        self.all = (self.W, self.SX, self.SY, self.VX, self.VY)

    def add(self, hx, hy, ux, uy, w, limit, cap):
        ix, iy = cells(hx, hy)
        f = ix * N + iy
        good = self.W[f] < limit
        if not good.any():
            return
        f = f[good]
        w = w[good]
        np.add.at(self.W, f, w)
        np.add.at(self.SX, f, w * (hx[good] - (ix[good] - C0)))
        np.add.at(self.SY, f, w * (hy[good] - (iy[good] - C0)))
        np.add.at(self.VX, f, w * ux[good])
        np.add.at(self.VY, f, w * uy[good])
        fu = np.unique(f)
        over = fu[self.W[fu] > cap]
        if over.size:
            sc = cap / self.W[over]
            for arr in self.all:
                arr[over] *= sc

    def decay(self, fl, ixs, iys, ri, x, y, ux, uy, strong, fs, fw, floor):
        """Cells that rays pass through lose weight."""
        wv = self.W[fl]
        q = np.nonzero(wv > 0)[0]
        if not q.size:
            return
        f = fl[q]
        iw = 1.0 / wv[q]
        cx = ixs[q] - C0 + self.SX[f] * iw - x
        cy = iys[q] - C0 + self.SY[f] * iw - y
        rq = ri[q]
        f = np.unique(f[np.abs(cx * uy[rq] - cy * ux[rq]) < 0.4])
        if f.size:
            fac = np.where(self.W[f] > strong, fs, fw).astype(np.float32)
            for arr in self.all:
                arr[f] *= fac
            dead = f[self.W[f] < floor]
            for arr in self.all:
                arr[dead] = 0.0

    def clear(self, f):
        f = f[self.W[f] > 0]
        for arr in self.all:
            arr[f] = 0.0


class Controller:
    def __init__(self, obs):
        goal = np.asarray(obs["goal"], dtype=np.float64).ravel()
        self.goal = (float(goal[0]), float(goal[1]))
        self.target = self.goal
        self.s = np.array([0.0, 0.0, 0.0, 1.0, 1.0])
        self.P = np.diag([1e-6, 1e-6, 1e-7, 0.0025, 0.0025])
        self.O = HitMap()        # sharp and recent: obstacles
        self.M = HitMap()        # anchored: scan matching
        self.W2 = self.O.W.reshape(N, N)
        self.SX2 = self.O.SX.reshape(N, N)
        self.SY2 = self.O.SY.reshape(N, N)
        self.F = np.zeros(N * N, np.uint8)
        self.F2 = self.F.reshape(N, N)
        self.n = 0
        self.scans = 0
        self.key = None
        self.inliers = 0
        self.zc = 0.0
        self.zs = 0.0
        self.zw = 0.0
        self.zn = 0
        self.pend = (0.0, 0.0)
        self.ga = [1.5, 1.5]
        self.gb = [1.5, 1.5]
        self.bb = [min(0.0, self.goal[0]), max(0.0, self.goal[0]),
                   min(0.0, self.goal[1]), max(0.0, self.goal[1])]
        self.path = None
        self.level = 0
        self.skip0 = 0
        self.next_plan = 0
        self.blocks = []
        self.hard = HARD
        self.stuck_at = None
        self.recent = deque(maxlen=3)
        self.rotating = 0
        self.hist = deque(maxlen=16)
        self.long = deque(maxlen=70)
        self.stuck = 0
        self.badband = 0
        self.spin = 0
        self.searching = False
        self.visited = []
        self.tdrive = 0
        self.near_count = 0
        self.errors = 0

    # ------------------------------------------------------------ pose
    def predict(self, od, ot):
        s = self.s
        kd, kt = s[3], s[4]
        d = kd * od
        t = kt * ot
        a = s[2] + 0.5 * t
        ca, sa = math.cos(a), math.sin(a)
        ch = d * (1.0 - t * t / 24.0)
        s[0] += ch * ca
        s[1] += ch * sa
        s[2] += t
        F = np.eye(5)
        F[0, 2] = -d * sa
        F[1, 2] = d * ca
        F[0, 3] = od * ca
        F[1, 3] = od * sa
        F[0, 4] = -d * sa * ot * 0.5
        F[1, 4] = d * ca * ot * 0.5
        F[2, 4] = ot
        G = np.zeros((5, 2))
        G[0, 0] = ca
        G[1, 0] = sa
        G[0, 1] = -0.5 * d * sa
        G[1, 1] = 0.5 * d * ca
        G[2, 1] = 1.0
        q = np.array([(0.1 * d) ** 2 + 1e-4, (0.1 * t) ** 2 + 2e-6])
        self.P = F @ self.P @ F.T + (G * q) @ G.T
        self.P[3, 3] += 2e-7
        self.P[4, 4] += 2e-7
        return d, t

    def segments(self, r):
        """Directions (body frame) of straight pieces of wall, with their standard deviation."""
        x = r * np.cos(ANG)
        y = r * np.sin(ANG)
        ok = r < 46.0
        tri = ok[:-2] & ok[1:-1] & ok[2:]
        i = np.nonzero(tri)[0]
        if i.size == 0:
            return np.zeros(0), np.zeros(0)
        dx = x[i + 2] - x[i]
        dy = y[i + 2] - y[i]
        ln = np.maximum(np.hypot(dx, dy), 1e-6)
        dev = np.abs((x[i + 1] - x[i]) * dy - (y[i + 1] - y[i]) * dx) / ln
        rm = r[i + 1]
        inc = np.abs(np.cos(ANG[i + 1]) * dy - np.sin(ANG[i + 1]) * dx) / ln
        sig = 0.0283 * rm * np.maximum(inc, 0.2) / ln + 0.02
        good = (ln > 2.5) & (ln < 22.0) & (dev < 0.3 + 0.03 * rm * inc) & (sig < 0.12)
        return np.arctan2(dy, dx)[good], sig[good]

    def match(self, r, hit):
        if self.scans == 0:
            return
        idx = np.nonzero(hit)[0]
        if idx.size < 3:
            self.inliers = 0
            return
        s = self.s
        pred = s.copy()
        pinv = np.linalg.inv(self.P + 1e-9 * np.eye(5))
        rr = r[idx]
        an = ANG[idx]
        taper = np.clip((56.0 - rr) / 8.0, 0.05, 1.0)
        sa, ss = self.segments(r)
        square = self.zn > 90 and math.hypot(self.zc, self.zs) > 0.55 * self.zw
        phi0 = math.atan2(self.zs, self.zc) / 4.0
        m = self.M
        H = np.zeros((5, 5))
        for it in range(5):
            ux = np.cos(s[2] + an)
            uy = np.sin(s[2] + an)
            lx = rr * ux
            ly = rr * uy
            ex = s[0] + lx
            ey = s[1] + ly
            ix, iy = cells(ex, ey)
            g = (ix * N + iy)[:, None] + OFF
            wg = m.W[g]
            inv = 1.0 / np.maximum(wg, 1e-6)
            rx = (ix - C0 - ex)[:, None] + OX + m.SX[g] * inv
            ry = (iy - C0 - ey)[:, None] + OY + m.SY[g] * inv
            face = (m.VX[g] * ux[:, None] + m.VY[g] * uy[:, None]) > 0
            c = 0.125 if it < 2 else 0.25
            k = np.minimum(wg, 12.0) * np.exp(-c * (rx * rx + ry * ry)) * face
            mass = k.sum(1)
            mi = 1.0 / np.maximum(mass, 1e-6)
            kx = k * rx
            ky = k * ry
            mx = kx.sum(1) * mi
            my = ky.sum(1) * mi
            cxx = (kx * rx).sum(1) * mi - mx * mx
            cyy = (ky * ry).sum(1) * mi - my * my
            cxy = (kx * ry).sum(1) * mi - mx * my
            phi = 0.5 * np.arctan2(2.0 * cxy, cxx - cyy)
            nx = -np.sin(phi)
            ny = np.cos(phi)
            tr = 0.5 * (cxx + cyy)
            df = np.sqrt((0.5 * (cxx - cyy)) ** 2 + cxy ** 2)
            l1 = np.maximum(tr + df, 1e-6)
            l2 = np.maximum(tr - df, 0.0)
            e = -(nx * mx + ny * my)
            ok = (mass > 0.25) & (l1 > 0.4) & (l1 > 2.5 * l2) & (np.abs(e) < 3.5)
            cosi = nx * ux + ny * uy
            var = (0.02 * rr * cosi) ** 2 + 0.07 + 0.4 * l2
            w = 0.65 * taper * ok * (1.0 - l2 / l1) / var
            w = w / (1.0 + e * e / (6.0 * var))
            J = np.stack([nx, ny, ny * lx - nx * ly], 1)
            H = np.zeros((5, 5))
            H[:3, :3] = J.T @ (J * w[:, None])
            rhs = -(pinv @ (s - pred))
            rhs[:3] -= J.T @ (w * e)
            if square and sa.size:
                q = sa + s[2] - phi0
                q = q - 0.5 * math.pi * np.round(q / (0.5 * math.pi))
                ws = 0.3 * (np.abs(q) < 0.14) / (ss * ss)
                H[2, 2] += float(ws.sum())
                rhs[2] -= float((ws * q).sum())
            dx = np.linalg.solve(H + pinv, rhs)
            s += dx
            self.inliers = int((ok & (np.abs(e) < 1.5)).sum())
            if it >= 2 and abs(dx[0]) + abs(dx[1]) < 0.01 and abs(dx[2]) < 4e-4:
                break
        s[3] = min(1.2, max(0.84, s[3]))
        s[4] = min(1.2, max(0.84, s[4]))
        P = np.linalg.inv(H + pinv)
        self.P = 0.5 * (P + P.T)

    # ------------------------------------------------------------ maps
    def insert(self, r, hit, turn):
        x, y, th = float(self.s[0]), float(self.s[1]), float(self.s[2])
        ux = np.cos(th + ANG)
        uy = np.sin(th + ANG)
        newkey = (self.key is None or self.scans < 5
                  or math.hypot(x - self.key[0], y - self.key[1]) > 2.2
                  or abs(th - self.key[2]) > 0.12)
        lim = np.where(hit, r - (0.5 + 0.05 * r), 49.0)
        ri, ki = np.nonzero(DIST[None, :] < lim[:, None])
        dd = DIST[ki]
        ixs, iys = cells(x + dd * ux[ri], y + dd * uy[ri])
        fl = ixs * N + iys
        self.F[fl] = 1
        self.O.decay(fl, ixs, iys, ri, x, y, ux, uy, 1.5, 0.88, 0.75, 0.05)
        if newkey:
            self.M.decay(fl, ixs, iys, ri, x, y, ux, uy, 6.0, 0.92, 0.8, 0.2)
        h = np.nonzero(hit)[0]
        if h.size:
            rh = r[h]
            hx = x + rh * ux[h]
            hy = y + rh * uy[h]
            sig2 = (0.02 * rh) ** 2 + (0.04 * turn * rh) ** 2
            w = 1.0 / (1.0 + 4.0 * (sig2 + 0.02))
            self.O.add(hx, hy, ux[h], uy[h], w, 8.0 * w, 6.0)
            if newkey and (self.inliers >= 5 or self.scans < 5 or self.lost > 4):
                wm = np.clip((56.0 - rh) / 8.0, 0.05, 1.0) / (sig2 + 0.15)
                self.M.add(hx, hy, ux[h], uy[h], wm, np.full(h.size, 60.0), 60.0)
                self.key = (x, y, th)
            bb = self.bb
            bb[0] = min(bb[0], float(hx.min()))
            bb[1] = max(bb[1], float(hx.max()))
            bb[2] = min(bb[2], float(hy.min()))
            bb[3] = max(bb[3], float(hy.max()))
        # wall directions
        if newkey:
            sa, ss = self.segments(r)
            if sa.size:
                w = 1.0 / (ss * ss)
                q = 4.0 * (sa + th)
                self.zc += float((w * np.cos(q)).sum())
                self.zs += float((w * np.sin(q)).sum())
                self.zw += float(w.sum())
                self.zn += int(sa.size)
        # nothing can be inside the body
        f = int(math.floor(x + C0 + 0.5)) * N + int(math.floor(y + C0 + 0.5)) + BODY
        self.F[f] = 1
        self.O.clear(f)
        self.M.clear(f)
        # raw near hits of the last scans; at a depth jump the edge may reach on towards the next ray
        near = np.nonzero(r < 15.0)[0]
        rad = [1.008 * r[near]]
        ang = [th + ANG[near]]
        for sh in (-1, 1):
            nb = near + sh
            a = near[(nb >= 0) & (nb < 24)]
            a = a[(r[a + sh] > r[a] + 2.5) & (r[a] < 12.0)]
            rad.append(1.008 * r[a])
            ang.append(th + ANG[a] + sh * 0.3 * SPACING)
        rad = np.concatenate(rad)
        ang = np.concatenate(ang)
        self.recent.append((x + rad * np.cos(ang), y + rad * np.sin(ang)))
        self.scans += 1

    def points(self, half=46):
        cx = int(math.floor(self.s[0] + C0 + 0.5))
        cy = int(math.floor(self.s[1] + C0 + 0.5))
        x0, x1 = max(1, cx - half), min(N - 1, cx + half + 1)
        y0, y1 = max(1, cy - half), min(N - 1, cy + half + 1)
        occ = occupied(self.W2[x0 - 1:x1 + 1, y0 - 1:y1 + 1], 0.14)
        ii, jj = np.nonzero(occ)
        ii = ii + x0
        jj = jj + y0
        w = self.W2[ii, jj]
        px = ii - C0 + self.SX2[ii, jj] / w
        py = jj - C0 + self.SY2[ii, jj] / w
        return px.astype(np.float64), py.astype(np.float64)

    def erase_local(self, rad):
        cx = int(math.floor(self.s[0] + C0 + 0.5))
        cy = int(math.floor(self.s[1] + C0 + 0.5))
        x0, x1 = max(1, cx - rad), min(N - 1, cx + rad + 1)
        y0, y1 = max(1, cy - rad), min(N - 1, cy + rad + 1)
        for arr in self.O.all:
            arr.reshape(N, N)[x0:x1, y0:y1] = 0.0

    # ------------------------------------------------------------ plan
    def grid(self):
        x, y = float(self.s[0]), float(self.s[1])
        tx, ty = self.target
        bb = self.bb
        bb[0] = min(bb[0], x, tx)
        bb[1] = max(bb[1], x, tx)
        bb[2] = min(bb[2], y, ty)
        bb[3] = max(bb[3], y, ty)
        x0 = max(2, int(math.floor(bb[0])) - 28 + C0)
        x1 = min(N - 2, int(math.ceil(bb[1])) + 28 + C0)
        y0 = max(2, int(math.floor(bb[2])) - 28 + C0)
        y1 = min(N - 2, int(math.ceil(bb[3])) + 28 + C0)
        x1 -= (x1 - x0) % 2
        y1 -= (y1 - y0) % 2
        h2, w2 = (x1 - x0) // 2, (y1 - y0) // 2
        occ = occupied(self.W2[x0 - 1:x1 + 1, y0 - 1:y1 + 1])
        D = np.sqrt(edt2(occ).astype(np.float32))
        blk = D.reshape(h2, 2, w2, 2).transpose(0, 2, 1, 3).reshape(h2, w2, 4)
        arg = blk.argmax(2).ravel()
        dm = blk.max(2)
        known = self.F2[x0:x1, y0:y1].reshape(h2, 2, w2, 2).max(axis=(1, 3)) > 0
        gx = (x0 - C0 + 0.5 + 2.0 * np.arange(h2))[:, None]
        gy = (y0 - C0 + 0.5 + 2.0 * np.arange(w2))[None, :]
        base = (1.0 + 0.12 * np.maximum(12.0 - dm, 0.0)
                + 0.9 * np.maximum(9.5 - dm, 0.0)).astype(np.float64)
        base[~known] *= 1.08
        return x0, y0, h2, w2, arg, dm, gx, gy, base, known

    def close_cells(self, cost, gx, gy, x, y, tx, ty):
        nr = ((gx - x) ** 2 + (gy - y) ** 2) < 20.0
        ng = ((gx - tx) ** 2 + (gy - ty) ** 2) < 20.0
        cost[nr] = np.minimum(cost[nr], 4.0)
        if not self.searching:
            cost[ng] = np.minimum(cost[ng], 4.0)
        cost[0, :] = BLOCK
        cost[-1, :] = BLOCK
        cost[:, 0] = BLOCK
        cost[:, -1] = BLOCK

    def cell_of(self, x, y, x0, y0, h2, w2):
        i = min(h2 - 2, max(1, int((x + C0 + 0.5 - x0) // 2)))
        j = min(w2 - 2, max(1, int((y + C0 + 0.5 - y0) // 2)))
        return i, j

    def plan(self):
        x, y, th = float(self.s[0]), float(self.s[1]), float(self.s[2])
        tx, ty = self.target
        x0, y0, h2, w2, arg, dm, gx, gy, base, _known = self.grid()
        si, sj = self.cell_of(x, y, x0, y0, h2, w2)
        gi, gj = self.cell_of(tx, ty, x0, y0, h2, w2)
        ax = np.abs(np.arange(h2) - gi)[:, None]
        ay = np.abs(np.arange(w2) - gj)[None, :]
        hval = (np.maximum(ax, ay) + 0.41421356 * np.minimum(ax, ay)).ravel().tolist()
        self.blocks = [b for b in self.blocks if b[2] > self.n]
        seq = None
        gs = None
        cost = base
        level = 0
        for level, thr in ((0, 7.4), (1, 6.6), (2, 4.5)):
            if level == 0 and self.n < self.skip0:
                continue
            if level > 0 and self.searching:
                break
            cost = base.copy()
            if level > 0:
                cost += 25.0 * np.maximum(7.4 - dm, 0.0)
            cost[dm < thr] = BLOCK
            if level == 0:
                for bx, by, _t in self.blocks:
                    cost[((gx - bx) ** 2 + (gy - by) ** 2) < 25.0] = BLOCK
            self.close_cells(cost, gx, gy, x, y, tx, ty)
            seq, gs = shortest(cost.ravel().tolist(), w2, si * w2 + sj, gi * w2 + gj, hval, 1e7)
            if seq is not None:
                break
            if level == 0:
                self.skip0 = self.n + 25
        if seq is None:
            self.path = None
            return False
        ids = np.array(seq)
        a = arg[ids]
        px = (x0 - C0 + 2.0 * (ids // w2) + (a // 2)).astype(np.float64)
        py = (y0 - C0 + 2.0 * (ids % w2) + (a % 2)).astype(np.float64)
        px[0], py[0] = x, y
        px[-1], py[-1] = tx, ty
        if len(ids) == 1:
            px = np.array([x, tx])
            py = np.array([y, ty])
            gs = [0.0, 1.0]

        def line_cost(ax_, ay_, bx_, by_):
            ln = math.hypot(bx_ - ax_, by_ - ay_)
            m = max(2, int(ln / 1.5) + 1)
            t = (np.arange(m) + 0.5) / m
            ci = np.clip(((ax_ + (bx_ - ax_) * t + (C0 + 0.5 - x0)) // 2).astype(np.int64), 0, h2 - 1)
            cj = np.clip(((ay_ + (by_ - ay_) * t + (C0 + 0.5 - y0)) // 2).astype(np.int64), 0, w2 - 1)
            return float(cost[ci, cj].mean()) * ln * 0.5

        keep = [0]
        i = 0
        last = len(px) - 1
        while i < last:
            nxt = i + 1
            for jump in (60, 45, 34, 26, 20, 15, 11, 8, 6, 4, 3, 2):
                j = i + jump
                if j > last:
                    if i + jump * 0.7 > last:
                        continue
                    j = last
                if line_cost(px[i], py[i], px[j], py[j]) <= (gs[j] - gs[i]) * 1.005:
                    nxt = j
                    break
            keep.append(nxt)
            i = nxt
        new = resample(np.stack([px[keep], py[keep]], 1))
        if len(new) < 2:
            new = np.array([[x, y], [tx + 1e-3, ty]])
        # keep the old path if the new one is not clearly better
        old = self.path
        if old is not None and len(old) > 4 and self.level == level:
            ci = np.clip(((old[:, 0] + (C0 + 0.5 - x0)) // 2).astype(np.int64), 0, h2 - 1)
            cj = np.clip(((old[:, 1] + (C0 + 0.5 - y0)) // 2).astype(np.int64), 0, w2 - 1)
            oc = float(cost[ci, cj].sum())
            if oc < 1e8:
                k1 = min(5, len(new) - 1)
                k2 = min(5, len(old) - 1)
                a1 = abs(wrap(math.atan2(new[k1, 1] - y, new[k1, 0] - x) - th))
                a2 = abs(wrap(math.atan2(old[k2, 1] - y, old[k2, 0] - x) - th))
                nc = float(gs[-1]) + 14.0 * max(0.0, a1 - a2) / math.pi
                if nc > 0.95 * oc:
                    return True
        self.path = new
        self.level = level
        return True

    def pick_search(self):
        """Nearest reachable cell around the goal estimate that was not visited yet."""
        x, y = float(self.s[0]), float(self.s[1])
        self.path = None
        self.next_plan = 0
        self.tdrive = 0
        self.skip0 = 0
        x0, y0, h2, w2, arg, dm, gx, gy, base, known = self.grid()
        cost = base.copy()
        cost[dm < 7.6] = BLOCK
        for bx, by, bt in self.blocks:
            if bt > self.n:
                cost[((gx - bx) ** 2 + (gy - by) ** 2) < 25.0] = BLOCK
        self.close_cells(cost, gx, gy, x, y, x, y)
        si, sj = self.cell_of(x, y, x0, y0, h2, w2)
        g, done = shortest(cost.ravel().tolist(), w2, si * w2 + sj, -1, None, 170.0)
        ids = np.nonzero(np.frombuffer(bytes(done), dtype=np.uint8))[0]
        a = arg[ids]
        px = x0 - C0 + 2.0 * (ids // w2) + (a // 2)
        py = y0 - C0 + 2.0 * (ids % w2) + (a % 2)
        dg = np.hypot(px - self.goal[0], py - self.goal[1])
        ok = (dg < 36.0) & (dm.ravel()[ids] >= 8.1)
        ids, px, py, dg = ids[ok], px[ok], py[ok], dg[ok]
        if ids.size:
            gv = np.array([g[k] for k in ids])
            v = np.array(self.visited + [(x, y)])
            md = np.full(ids.size, 1e9)
            for k in range(0, len(v), 200):
                b = v[k:k + 200]
                d2 = (px[:, None] - b[:, 0]) ** 2 + (py[:, None] - b[:, 1]) ** 2
                md = np.minimum(md, d2.min(1))
            for rad in (9.0, 15.0, 21.0, 28.0, 36.0):
                sel = np.nonzero((dg < rad) & (md > 3.4 ** 2))[0]
                if sel.size:
                    k = sel[int(np.argmin(gv[sel] + 0.3 * dg[sel]))]
                    self.target = (float(px[k]), float(py[k]))
                    return
        self.visited = []
        self.target = self.goal

    def relax(self, band, px, py, iters=6):
        if len(band) < 3:
            return band
        b = band.copy()
        for _ in range(iters):
            if px.size:
                dx = b[:, 0][:, None] - px[None, :]
                dy = b[:, 1][:, None] - py[None, :]
                d = np.sqrt(dx * dx + dy * dy) + 1e-6
                dmin = d.min(1)
                w = np.exp(-(d - dmin[:, None]) / 0.8) * (d < 12.5)
                ws = np.maximum(w.sum(1), 1e-6)
                w = w / d
                mag = np.minimum(0.6, 0.3 * np.maximum(0.0, 11.0 - dmin)) / ws
                fx = (w * dx).sum(1) * mag
                fy = (w * dy).sum(1) * mag
                b[:-1, 0] += fx[:-1]
                b[:-1, 1] += fy[:-1]
            b[1:-1] += 0.35 * (0.5 * (b[:-2] + b[2:]) - b[1:-1])
        return b

    # ------------------------------------------------------------ drive
    def gains(self):
        gl = self.gb[0] / self.ga[0]
        gr = self.gb[1] / self.ga[1]
        return min(1.2, max(0.8, gl)), min(1.2, max(0.8, gr))

    def send(self, ul, ur):
        gl, gr = self.gains()
        cl = max(-1.0, min(1.0, ul / gl))
        cr = max(-1.0, min(1.0, ur / gr))
        self.pend = (cl, cr)
        return float(cl), float(cr)

    def choose(self, q0, band, ox, oy):
        """ox, oy: obstacle points near q0, from the map and from the last scans."""
        x0, y0, t0 = q0
        gl, gr = self.gains()
        ml = 0.99 * min(1.0, gl)
        mr = 0.99 * min(1.0, gr)
        f = np.minimum(1.0, np.minimum(ml / np.maximum(np.abs(CL), 1e-3),
                                       mr / np.maximum(np.abs(CR), 1e-3)))
        ul = CL * f
        ur = CR * f
        v = 0.5 * (ul + ur)
        d = v * STEP
        t = (ul - ur) * STEP / AX
        k = np.arange(1, 5)
        thm = t0 + (k[None, :] - 0.5) * t[:, None]
        X = x0 + np.cumsum(d[:, None] * np.cos(thm), 1)
        Y = y0 + np.cumsum(d[:, None] * np.sin(thm), 1)
        the = t0 + 4.0 * t
        if ox.size:
            d2 = (X[:, :, None] - ox) ** 2 + (Y[:, :, None] - oy) ** 2
            clear = np.sqrt(d2.min(2))
            c0 = math.sqrt(float(((ox - x0) ** 2 + (oy - y0) ** 2).min()))
        else:
            clear = np.full(X.shape, 20.0)
            c0 = 20.0
        c3 = clear[:, :3].min(1)
        c4 = clear.min(1)
        ex = X[:, 3]
        ey = Y[:, 3]
        m = len(band)
        tang = np.zeros_like(band)
        tang[:-1] = band[1:] - band[:-1]
        tang[-1] = tang[-2]
        ln = np.maximum(np.hypot(tang[:, 0], tang[:, 1]), 1e-6)
        cum = np.concatenate(([0.0], np.cumsum(ln[:-1])))
        tang = tang / ln[:, None]
        bd2 = (ex[:, None] - band[:, 0]) ** 2 + (ey[:, None] - band[:, 1]) ** 2
        j = bd2.argmin(1)
        rx = ex - band[j, 0]
        ry = ey - band[j, 1]
        al = rx * tang[j, 0] + ry * tang[j, 1]
        lat2 = (rx * tang[j, 1] - ry * tang[j, 0]) ** 2
        end = j == m - 1
        prog = cum[j] + np.where(end, np.minimum(al, 3.0 if self.searching else 8.0), al)
        j2 = np.minimum(j + 1, m - 1)
        he = the - np.arctan2(tang[j2, 1], tang[j2, 0])
        he = (he + math.pi) % (2.0 * math.pi) - math.pi
        cost = -prog + 0.3 * np.minimum(lat2, 100.0) + 3.0 * he * he
        vlim = np.clip(0.3 + 0.47 * (c4 - 8.3), 0.2, 1.0)
        cost = cost + 60.0 * np.maximum(0.0, v - vlim) ** 2
        cost = cost + 14.0 * np.maximum(0.0, 9.1 - c4) ** 2 + 60.0 * np.maximum(0.0, 8.5 - c3) ** 2
        floor = min(self.hard, c0 - 0.01)
        cost = np.where(c3 < floor, cost + 1000.0 + 100.0 * (floor - c3), cost)
        b = int(np.argmin(cost))
        return float(ul[b]), float(ur[b])

    def turn_on_spot(self, s, q0, ox, oy):
        """Turn; close to a wall slower, and easing away from it."""
        v = 0.0
        if ox.size:
            dx = q0[0] - ox
            dy = q0[1] - oy
            d = np.sqrt(dx * dx + dy * dy) + 1e-6
            c0 = float(d.min())
            if c0 < 9.0:
                w = np.exp(-(d - c0) / 0.5)
                w = w / w.sum()
                ax = float((w * dx / d).sum())
                ay = float((w * dy / d).sum())
                al = ax * math.cos(q0[2]) + ay * math.sin(q0[2])
                v = 0.16 * al * min(1.0, 9.0 - c0)
                v = max(-0.1, min(0.16, v))
                s = max(-0.37, min(0.37, s))
                # do not ease into something on the other side
                nx = q0[0] + 6.0 * v * math.cos(q0[2])
                ny = q0[1] + 6.0 * v * math.sin(q0[2])
                if float(((nx - ox) ** 2 + (ny - oy) ** 2).min()) < c0 * c0:
                    v = 0.0
        return self.send(v + s, v - s)

    def add_block(self, x, y):
        self.blocks.append((float(x), float(y), self.n + 260))
        self.path = None
        self.next_plan = 0
        self.badband = 0

    def give_up_target(self):
        self.visited.append(self.target)
        self.pick_search()

    def act(self, obs):
        used = time.process_time()
        slack = 2.0 + 0.02 * self.n - used
        self.n += 1
        odo = np.asarray(obs["odometry"], dtype=np.float64).ravel()
        ws = np.asarray(obs["wheel_speeds"], dtype=np.float64).ravel()
        r = np.clip(np.asarray(obs["ranges"], dtype=np.float64).ravel(), 0.5, 60.0)
        d, t = self.predict(float(odo[0]), float(odo[1]))
        meas = ((d + 0.5 * AX * t) / STEP, (d - 0.5 * AX * t) / STEP)
        for i in (0, 1):
            c = float(ws[i])
            if abs(c) > 0.08:
                wt = 1.0 if abs(c) < 0.88 else 0.25
                self.ga[i] += wt * c * c
                self.gb[i] += wt * c * meas[i]
        if slack < 0.12:
            return self.send(0.0, 0.0)
        hit = r < HIT_MAX
        self.match(r, hit)
        self.lost = self.lost + 1 if self.inliers < 5 else 0
        self.insert(r, hit, t)
        x, y, th = float(self.s[0]), float(self.s[1]), float(self.s[2])
        px, py = self.points()

        # state after the step that is already decided
        gl, gr = self.gains()
        el = max(-1.0, min(1.0, self.pend[0] * gl))
        er = max(-1.0, min(1.0, self.pend[1] * gr))
        pd = 0.5 * (el + er) * STEP
        pt = (el - er) * STEP / AX
        q0 = (x + pd * math.cos(th + 0.5 * pt), y + pd * math.sin(th + 0.5 * pt), th + pt)

        # obstacle points for the next steps
        near = (px - q0[0]) ** 2 + (py - q0[1]) ** 2 < 24.0 ** 2
        ox = np.concatenate([px[near]] + [p[0] for p in self.recent])
        oy = np.concatenate([py[near]] + [p[1] for p in self.recent])

        if self.spin > 0:
            self.spin -= 1
            return self.turn_on_spot(0.42, q0, ox, oy)

        # target
        if math.hypot(self.goal[0] - x, self.goal[1] - y) < 45.0:
            if not self.visited or math.hypot(self.visited[-1][0] - x, self.visited[-1][1] - y) > 1.5:
                self.visited.append((x, y))
        dist = math.hypot(self.target[0] - x, self.target[1] - y)
        if not self.searching:
            self.near_count = self.near_count + 1 if dist < 3.0 else 0
            if dist < 1.4 or self.near_count > 3:
                self.searching = True
                self.pick_search()
        elif slack > 0.4:
            if dist < 2.3:
                self.visited.append(self.target)
                self.pick_search()
            elif self.tdrive > 70:
                self.give_up_target()

        # stuck: neither driven nor turned
        if self.stuck_at is not None and math.hypot(x - self.stuck_at[0], y - self.stuck_at[1]) > 22.0:
            self.stuck_at = None
            self.hard = HARD
        self.hist.append((x, y, th))
        self.long.append((x, y))
        event = False
        if len(self.hist) == self.hist.maxlen:
            a = np.array(self.hist)
            e = a.max(0) - a.min(0)
            event = e[0] < 1.6 and e[1] < 1.6 and e[2] < 0.5
        if not event and len(self.long) == self.long.maxlen:
            a = np.array(self.long)
            e = a.max(0) - a.min(0)
            event = e[0] < 3.0 and e[1] < 3.0
        if event:
            self.hist.clear()
            self.long.clear()
            self.stuck += 1
            self.stuck_at = (x, y)
            kind = self.stuck % 3
            if self.searching and kind != 0 and slack > 0.4:
                self.hard = max(7.95, self.hard - 0.08)
                self.give_up_target()
            elif not self.searching and math.hypot(self.goal[0] - x, self.goal[1] - y) < 20.0 and kind == 2:
                self.searching = True
                self.pick_search()
            elif kind == 1:
                self.hard = max(7.9, self.hard - 0.16)
            elif kind == 2 and self.path is not None and len(self.path) > 2:
                self.hard = max(7.9, self.hard - 0.08)
                k = min(5, len(self.path) - 1)
                self.add_block(self.path[k, 0], self.path[k, 1])
            else:
                self.blocks = []
                self.hard = max(7.8, self.hard - 0.16)
                self.erase_local(36)
                self.path = None
                self.next_plan = 0
                self.spin = 28
                return self.turn_on_spot(0.42, q0, ox, oy)

        # path
        if self.path is not None:
            m = min(25, len(self.path))
            dd = (self.path[:m, 0] - x) ** 2 + (self.path[:m, 1] - y) ** 2
            j = int(dd.argmin())
            if dd[j] > 49.0:
                self.path = None
                self.next_plan = 0
            elif j > 0 and len(self.path) - j >= 2:
                self.path = self.path[j:]
        if self.n >= self.next_plan and slack > (0.3 if self.path is None else 0.6):
            t0 = time.process_time()
            ok = self.plan()
            if ok and self.level > 0 and not self.searching and dist < 45.0:
                # the estimate of the goal is in a wall or behind one
                self.searching = True
                self.pick_search()
                ok = self.plan()
            if not ok and self.searching:
                self.give_up_target()
            cpu = time.process_time() - t0
            gap = cpu / (0.008 if slack > 1.0 else 0.004)
            self.next_plan = self.n + max(4, int(gap) + 1)
        if self.path is None:
            if slack < 0.3:
                return self.send(0.0, 0.0)
            return self.turn_on_spot(0.37, q0, ox, oy)

        # band
        m = min(24, len(self.path))
        band = self.relax(self.path[:m], px, py)
        band = resample(band)
        if len(band) < 2:
            band = np.array([[x, y], [self.target[0] + 1e-3, self.target[1]]])
        rest = self.path[m:]
        self.path = np.concatenate([band, rest], 0) if len(rest) else band
        if px.size and self.level == 0:
            kb = min(8, len(band))
            bx = band[:kb, 0][:, None] - px[None, :]
            by = band[:kb, 1][:, None] - py[None, :]
            cb = np.sqrt((bx * bx + by * by).min(1))
            k = int(cb.argmin())
            if cb[k] < 7.85 and k > 0:
                self.badband += 1
                if self.badband >= 8:
                    self.badband = 0
                    if self.searching:
                        if slack > 0.4:
                            self.give_up_target()
                    else:
                        self.add_block(band[k, 0], band[k, 1])
                    return self.send(0.0, 0.0)
            else:
                self.badband = 0

        # turn on the spot or drive
        dd = (band[:, 0] - q0[0]) ** 2 + (band[:, 1] - q0[1]) ** 2
        k = min(int(dd.argmin()) + 4, len(band) - 1)
        a = wrap(math.atan2(band[k, 1] - q0[1], band[k, 0] - q0[0]) - q0[2])
        if math.sqrt(dd[k]) < 1.0:
            a = 0.0
        if self.rotating == 0:
            if abs(a) > 1.05:
                self.rotating = 1 if a > 0 else -1
        elif abs(a) < 0.5:
            self.rotating = 0
        elif abs(a) < 2.4:
            self.rotating = 1 if a > 0 else -1
        if self.rotating != 0:
            s = self.rotating * min(0.5, max(0.2, abs(a) / 0.6))
            return self.turn_on_spot(s, q0, ox, oy)
        self.tdrive += 1
        ul, ur = self.choose(q0, band, ox, oy)
        return self.send(ul, ur)

    lost = 0


STATE = {"c": None}


def reset(obs):
    STATE["c"] = Controller(obs)


def policy(obs):
    if STATE["c"] is None:
        STATE["c"] = Controller(obs)
    c = STATE["c"]
    try:
        left, right = c.act(obs)
    except Exception:
        c.errors += 1
        c.path = None
        c.next_plan = 0
        left, right = c.send(0.0, 0.0)
    if not (math.isfinite(left) and math.isfinite(right)):
        left, right = c.send(0.0, 0.0)
    return float(left), float(right)
