import time
T_START = time.process_time()
import math
from collections import deque
import numpy as np

RADIUS = 8.6
OFF = 840                 # offset of the fine grid, 1 px cells
NF = 1680                 # fine grid cells per side
NC = NF // 2              # coarse (planning) grid, 2 px cells
R_EDT = 13
CAP2 = R_EDT * R_EDT
PAD = 14
WEAK = 20                 # squared distance handicap of badly seen obstacles
HIT_MAX = 186.0

N_RAYS = 90
RAY = np.deg2rad(-135.0 + np.arange(N_RAYS) * (270.0 / (N_RAYS - 1)))
T_PASS = np.arange(1.0, 186.0, 1.0)
W_PASS = (100.0 / np.maximum(T_PASS, 10.0) ** 2).astype(np.float32)
W_PASS_ALL = np.ascontiguousarray(np.broadcast_to(W_PASS, (N_RAYS, T_PASS.size)))

_by, _bx = np.mgrid[-7:8, -7:8]
_bm = (_bx * _bx + _by * _by) <= 49
BODY_OFF = (_by[_bm] * NF + _bx[_bm]).astype(np.int64)

_dl = [0.03, 0.06, 0.10, 0.15, 0.20, 0.28, 0.38, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5]
DELTAS = np.array([0.0] + [s * d for d in _dl for s in (1.0, -1.0)])
T_CAND = np.array([1.0, 2.0, 3.0, 4.5, 6.0, 7.5])
ALL_DIRS = np.arange(24) * (2.0 * math.pi / 24.0)

_d = np.sqrt(np.arange(1001, dtype=np.float64))
LUT = np.interp(_d, [8.0, 8.6, 9.0, 9.5, 10.5, 12.5],
                [5.0, 3.5, 2.0, 1.35, 1.12, 1.0]).astype(np.float32)
LUT2 = LUT.copy()
LUT[:64] = np.inf
LUT2[:64] = 12.0
LUT2[:40] = 25.0
LUT2[:16] = 80.0

SQ2 = math.sqrt(2.0)
HALF_LEN = (0.5 * np.array([SQ2, 1.0, SQ2, 1.0, 1.0, SQ2, 1.0, SQ2])).astype(np.float32)


def wrap(a):
    return (a + math.pi) % (2.0 * math.pi) - math.pi


def box3(h):
    v = h.copy()
    v[1:] += h[:-1]
    v[:-1] += h[1:]
    b = v.copy()
    b[:, 1:] += v[:, :-1]
    b[:, :-1] += v[:, 1:]
    return b


def edt2(f):
    g = f.copy()
    for k in range(1, R_EDT + 1):
        kk = np.int16(k * k)
        np.minimum(g[k:], f[:-k] + kk, out=g[k:])
        np.minimum(g[:-k], f[k:] + kk, out=g[:-k])
    d = g.copy()
    for k in range(1, R_EDT + 1):
        kk = np.int16(k * k)
        np.minimum(d[:, k:], g[:, :-k] + kk, out=d[:, k:])
        np.minimum(d[:, :-k], g[:, k:] + kk, out=d[:, :-k])
    return d


def search_field(C, gi, ri, t_limit):
    """Vectorised A* wave from the goal cell gi until the robot cell ri is settled.
    C: 2-D costs with an infinite border. Returns flat cost-to-go."""
    h, w = C.shape
    Cf = C.ravel()
    ry, rx = divmod(ri, w)
    yy = (np.arange(h, dtype=np.float32) - ry) ** 2
    xx = (np.arange(w, dtype=np.float32) - rx) ** 2
    heur = (np.sqrt(yy[:, None] + xx[None, :]) * np.float32(0.999)).ravel()
    G = np.full(Cf.size, np.inf, dtype=np.float32)
    offs = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], dtype=np.int64)
    G[gi] = 0.0
    act = np.array([gi], dtype=np.int64)
    delta = np.float32(3.0)
    eps = np.float32(1e-3)
    it = 0
    t0 = time.process_time()
    while act.size:
        it += 1
        if it % 64 == 0 and time.process_time() - t0 > t_limit:
            break
        ga = G[act]
        fa = ga + heur[act]
        m = fa.min()
        if m > G[ri]:
            break
        ms = fa <= m + delta
        sel = act[ms]
        rest = act[~ms]
        nb = sel[:, None] + offs
        cand = ga[ms][:, None] + (Cf[sel][:, None] + Cf[nb]) * HALF_LEN
        mk = cand < (G[nb] - eps)
        nbm = nb[mk]
        if nbm.size:
            cm = cand[mk]
            o = np.argsort(-cm)
            G[nbm[o]] = cm[o]
            act = np.unique(np.concatenate((rest, nbm)))
        else:
            act = rest
    return G, Cf, offs


class Nav:
    def __init__(self, obs):
        self.gx = float(obs["goal"][0])
        self.gy = float(obs["goal"][1])
        self.H = np.zeros(NF * NF, dtype=np.float32)
        self.M = np.zeros(NF * NF, dtype=np.float32)
        self.SX = np.zeros(NF * NF, dtype=np.float32)
        self.SY = np.zeros(NF * NF, dtype=np.float32)
        self.H2 = self.H.reshape(NF, NF)
        self.M2 = self.M.reshape(NF, NF)
        self.SX2 = self.SX.reshape(NF, NF)
        self.SY2 = self.SY.reshape(NF, NF)
        self.D2 = np.full((NF, NF), CAP2, dtype=np.int16)
        self.RD = np.zeros((NF, NF), dtype=np.int16)
        self.CC = np.full((NC, NC), CAP2, dtype=np.int16)
        self.COST = np.ones((NC, NC), dtype=np.float32)
        self.PEN = np.zeros((NC, NC), dtype=np.float32)
        self.bb = [min(0.0, self.gx), max(0.0, self.gx), min(0.0, self.gy), max(0.0, self.gy)]
        self.n = 0
        self.last_plan = -1000
        self.t_plan = 0.05
        self.force = True
        self.have_path = False
        self.pcx = None
        self.pcy = None
        self.PX = None
        self.PY = None
        self.i0 = 0
        self.hist = deque(maxlen=40)
        self.relax = 0
        self.blocked = 0
        self.no_keep = False
        self.px = np.zeros(0)
        self.py = np.zeros(0)
        self.errors = 0

    # ------------------------------------------------------------ mapping
    def add_hits(self, hx, hy, w):
        fx = hx + OFF
        fy = hy + OFF
        ix = np.floor(fx).astype(np.int64)
        iy = np.floor(fy).astype(np.int64)
        ok = (ix > 2) & (ix < NF - 3) & (iy > 2) & (iy < NF - 3)
        if not ok.all():
            fx, fy, ix, iy, w = fx[ok], fy[ok], ix[ok], iy[ok], w[ok]
        if ix.size == 0:
            return
        idx = iy * NF + ix
        w = w.astype(np.float32)
        np.add.at(self.H, idx, w)
        np.add.at(self.SX, idx, (w * (fx - ix)).astype(np.float32))
        np.add.at(self.SY, idx, (w * (fy - iy)).astype(np.float32))

    def sense(self, x, y, th, ranges):
        r = np.asarray(ranges, dtype=np.float64)
        ang = th + RAY
        ca = np.cos(ang)
        sa = np.sin(ang)
        hit = r < HIT_MAX
        hxa = x + r * ca
        hya = y + r * sa
        # free space along the rays
        lim = np.where(hit, 0.98 * r - 0.7, 0.9 * r)
        mask = T_PASS[None, :] < lim[:, None]
        fx = (x + OFF) + ca[:, None] * T_PASS
        fy = (y + OFF) + sa[:, None] * T_PASS
        idx = fy[mask].astype(np.int64) * NF + fx[mask].astype(np.int64)
        np.clip(idx, 0, NF * NF - 1, out=idx)
        self.M[idx] += W_PASS_ALL[mask]
        # hits
        if hit.any():
            rh = r[hit]
            self.add_hits(hxa[hit], hya[hit], 100.0 / np.maximum(rh, 10.0) ** 2)
        # points between far neighbouring hits that the body cannot pass
        gap = np.hypot(np.diff(hxa), np.diff(hya))
        rm = 0.5 * (r[1:] + r[:-1])
        mm = hit[1:] & hit[:-1] & (rm > 50.0) & (gap > 4.0) & (gap < 17.0)
        if mm.any():
            mx = 0.5 * (hxa[1:] + hxa[:-1])[mm]
            my = 0.5 * (hya[1:] + hya[:-1])[mm]
            self.add_hits(mx, my, 50.0 / rm[mm] ** 2)
        # the body itself is in free space
        b = BODY_OFF + (int(y + OFF) * NF + int(x + OFF))
        np.clip(b, 0, NF * NF - 1, out=b)
        self.H[b] = 0.0
        self.SX[b] = 0.0
        self.SY[b] = 0.0
        # extent of what has been seen
        k = np.where(hit, 1.0, 0.9)
        ex = x + k * r * ca
        ey = y + k * r * sa
        bb = self.bb
        bb[0] = min(bb[0], float(ex.min()))
        bb[1] = max(bb[1], float(ex.max()))
        bb[2] = min(bb[2], float(ey.min()))
        bb[3] = max(bb[3], float(ey.max()))

    def occupied(self, y0, y1, x0, x1):
        h = self.H2[y0:y1, x0:x1]
        m = self.M2[y0:y1, x0:x1]
        b = box3(h)
        occ = (h > 1e-7) & (h > 0.15 * m) & (h > 0.1 * b)
        return occ, b

    def local_points(self, x, y, rad):
        ix = int(x + OFF)
        iy = int(y + OFF)
        x0 = max(ix - rad, 0)
        x1 = min(ix + rad + 1, NF)
        y0 = max(iy - rad, 0)
        y1 = min(iy + rad + 1, NF)
        occ, _b = self.occupied(y0, y1, x0, x1)
        ys, xs = np.nonzero(occ)
        ya = ys + y0
        xa = xs + x0
        h = self.H2[ya, xa].astype(np.float64)
        px = xa - OFF + self.SX2[ya, xa] / h
        py = ya - OFF + self.SY2[ya, xa] / h
        return px, py

    def update_dist(self, x, y):
        ix = int(x + OFF)
        iy = int(y + OFF)
        rad = 206
        x0 = max(ix - rad, PAD) & ~1
        x1 = min(ix + rad, NF - PAD) & ~1
        y0 = max(iy - rad, PAD) & ~1
        y1 = min(iy + rad, NF - PAD) & ~1
        occ, b = self.occupied(y0 - PAD, y1 + PAD, x0 - PAD, x1 + PAD)
        f = np.full(occ.shape, 1000, dtype=np.int16)
        f[occ] = WEAK
        f[occ & (b >= 0.08)] = 0
        d = edt2(f)[PAD:-PAD, PAD:-PAD]
        d = np.minimum(d, np.int16(CAP2))
        rd = self.RD[y0:y1, x0:x1]
        use = (rd > 0) & (np.abs(d - rd) < 16)
        self.D2[y0:y1, x0:x1] = np.where(use, rd, d)
        self.refine(x, y)
        dd = self.D2[y0:y1, x0:x1]
        cm = np.maximum(np.maximum(dd[0::2, 0::2], dd[1::2, 0::2]),
                        np.maximum(dd[0::2, 1::2], dd[1::2, 1::2]))
        self.CC[y0 // 2:y1 // 2, x0 // 2:x1 // 2] = cm
        self.COST[y0 // 2:y1 // 2, x0 // 2:x1 // 2] = LUT[cm]

    def refine(self, x, y):
        px, py = self.local_points(x, y, 50)
        if px.size == 0:
            return
        ix = int(x + OFF)
        iy = int(y + OFF)
        rad = 34
        x0 = max(ix - rad, 0)
        x1 = min(ix + rad + 1, NF)
        y0 = max(iy - rad, 0)
        y1 = min(iy + rad + 1, NF)
        sub = self.D2[y0:y1, x0:x1]
        ys, xs = np.nonzero((sub > 36) & (sub < 121))
        if ys.size == 0:
            return
        ya = ys + y0
        xa = xs + x0
        cx = (xa - OFF + 0.5).astype(np.float32)
        cy = (ya - OFF + 0.5).astype(np.float32)
        pxf = px.astype(np.float32)
        pyf = py.astype(np.float32)
        q = np.empty(cx.size, dtype=np.float32)
        for s in range(0, cx.size, 256):
            dx = cx[s:s + 256, None] - pxf
            dy = cy[s:s + 256, None] - pyf
            q[s:s + 256] = (dx * dx + dy * dy).min(axis=1)
        vals = np.clip(np.rint(q), 1, CAP2).astype(np.int16)
        self.D2[ya, xa] = vals
        self.RD[ya, xa] = vals

    # ------------------------------------------------------------ planning
    def plan(self, x, y):
        self.update_dist(x, y)
        bb = self.bb
        mg = 60.0
        cx0 = int((min(bb[0], x) - mg + OFF) // 2)
        cx1 = int((max(bb[1], x) + mg + OFF) // 2) + 1
        cy0 = int((min(bb[2], y) - mg + OFF) // 2)
        cy1 = int((max(bb[3], y) + mg + OFF) // 2) + 1
        cx0 = max(cx0, 1)
        cy0 = max(cy0, 1)
        cx1 = min(cx1, NC - 1)
        cy1 = min(cy1, NC - 1)
        w = cx1 - cx0
        h = cy1 - cy0
        rcx = min(max(int((x + OFF) // 2) - cx0, 4), w - 5)
        rcy = min(max(int((y + OFF) // 2) - cy0, 4), h - 5)
        gcx = min(max(int((self.gx + OFF) // 2) - cx0, 4), w - 5)
        gcy = min(max(int((self.gy + OFF) // 2) - cy0, 4), h - 5)
        ri = rcy * w + rcx
        gi = gcy * w + gcx
        pen = self.PEN[cy0:cy1, cx0:cx1]
        G = None
        Cf = None
        offs = None
        found = False
        relaxed = False
        for attempt in range(2):
            if attempt == 0:
                C = self.COST[cy0:cy1, cx0:cx1] + pen
            else:
                C = LUT2[self.CC[cy0:cy1, cx0:cx1]] + pen
                relaxed = True
            for (qy, qx, val) in ((rcy, rcx, 4.0), (gcy, gcx, 1.0)):
                blk = C[qy - 2:qy + 3, qx - 2:qx + 3]
                np.minimum(blk, np.float32(val), out=blk)
            C[0, :] = np.inf
            C[-1, :] = np.inf
            C[:, 0] = np.inf
            C[:, -1] = np.inf
            C = np.ascontiguousarray(C, dtype=np.float32)
            G, Cf, offs = search_field(C, gi, ri, 0.45)
            if np.isfinite(G[ri]):
                found = True
                break
        if not found:
            return
        path = [ri]
        cur = ri
        for _k in range(4000):
            if cur == gi:
                break
            nbs = cur + offs
            v = G[nbs] + (Cf[cur] + Cf[nbs]) * HALF_LEN
            nxt = int(nbs[int(np.argmin(v))])
            if not G[nxt] < G[cur]:
                break
            path.append(nxt)
            cur = nxt
        p = np.array(path, dtype=np.int64)
        ncy = p // w + cy0
        ncx = p % w + cx0
        nx = 2.0 * ncx + 1.0 - OFF
        ny = 2.0 * ncy + 1.0 - OFF
        # hysteresis against flipping between nearly equal ways
        if self.have_path and not relaxed and not self.no_keep and self.PX.size - self.i0 > 14 and p.size > 14:
            j = self.i0
            a_old = math.atan2(self.PY[j + 12] - y, self.PX[j + 12] - x)
            a_new = math.atan2(ny[12] - y, nx[12] - x)
            if abs(wrap(a_old - a_new)) > 0.7:
                oc = self.COST[self.pcy[j:], self.pcx[j:]] + self.PEN[self.pcy[j:], self.pcx[j:]]
                oc = oc.astype(np.float64)
                oc[:3] = np.minimum(oc[:3], 4.0)
                oc[-3:] = np.minimum(oc[-3:], 1.0)
                ln = 0.5 * np.hypot(np.diff(self.PX[j:]), np.diff(self.PY[j:]))
                old_cost = float(np.sum(0.5 * (oc[1:] + oc[:-1]) * ln))
                old_cost += 0.5 * math.hypot(self.PX[j] - x, self.PY[j] - y)
                if math.isfinite(old_cost) and old_cost <= float(G[ri]) + 8.0:
                    return
        self.no_keep = False
        self.pcx = ncx
        self.pcy = ncy
        self.PX = nx
        self.PY = ny
        self.i0 = 0
        self.have_path = True

    def los(self, x, y, idxs, thr_all):
        tx = self.PX[idxs]
        ty = self.PY[idxs]
        L = np.hypot(tx - x, ty - y)
        s = min(int(float(L.max()) / 2.5) + 2, 280)
        u = np.linspace(0.0, 1.0, s)
        sx = ((x + OFF) + (tx - x)[:, None] * u).astype(np.int64)
        sy = ((y + OFF) + (ty - y)[:, None] * u).astype(np.int64)
        d = self.D2[sy, sx]
        dist = L[:, None] * u
        thr = thr_all[idxs][:, None]
        d0 = int(self.D2[int(y + OFF), int(x + OFF)])
        thr2 = np.where(dist < 10.0, np.minimum(thr, d0 - 6), thr)
        return (d >= thr2).all(axis=1)

    def pick_target(self, x, y):
        """Returns target x, y and whether it is properly visible."""
        if not self.have_path:
            return self.gx, self.gy, False
        n = self.PX.size
        a = self.i0
        b = min(n, a + 25)
        dd = (self.PX[a:b] - x) ** 2 + (self.PY[a:b] - y) ** 2
        self.i0 = a + int(np.argmin(dd))
        i0 = self.i0
        if i0 >= n - 2:
            return self.gx, self.gy, True
        vals = self.CC[self.pcy, self.pcx].astype(np.int64)
        vals[:min(i0 + 4, n)] = CAP2
        pm = np.minimum.accumulate(vals)
        thr_all = np.maximum(np.minimum(88, pm - 8), 66)
        near_end = min(i0 + 12, n - 1)
        c1 = np.arange(i0 + 1, near_end + 1)
        c2 = np.linspace(near_end, n - 1, 28).astype(np.int64)
        cands = np.unique(np.concatenate((c1, c2)))
        ok = self.los(x, y, cands, thr_all)
        vis = np.nonzero(ok)[0]
        if vis.size == 0:
            k = min(i0 + 3, n - 1)
            return float(self.PX[k]), float(self.PY[k]), False
        kk = int(vis[-1])
        best = int(cands[kk])
        if kk + 1 < cands.size:
            nxt = int(cands[kk + 1])
            if nxt - best > 1:
                more = np.arange(best + 1, nxt)
                ok2 = self.los(x, y, more, thr_all)
                v2 = np.nonzero(ok2)[0]
                if v2.size:
                    best = int(more[int(v2[-1])])
        if best >= n - 1:
            return self.gx, self.gy, True
        return float(self.PX[best]), float(self.PY[best]), True

    # ------------------------------------------------------------ local control
    def clear(self, qx, qy):
        if self.px.size == 0:
            return np.full(np.shape(qx), 27.0)
        dx = np.asarray(qx)[..., None] - self.px
        dy = np.asarray(qy)[..., None] - self.py
        return np.sqrt((dx * dx + dy * dy).min(axis=-1))

    def arc_clear(self, x, y, th, left, right):
        turn = (left - right) * 2.0 / 15.0
        s = left + right
        f = np.array([0.25, 0.5, 0.75, 1.0])
        if abs(turn) < 1e-6:
            qx = x + s * f * math.cos(th)
            qy = y + s * f * math.sin(th)
        else:
            rr = s / turn
            qx = x + rr * (np.sin(th + turn * f) - math.sin(th))
            qy = y - rr * (np.cos(th + turn * f) - math.cos(th))
        return float(self.clear(qx, qy).min())

    def penalise(self, x, y, phi):
        qx = x + 9.0 * math.cos(phi)
        qy = y + 9.0 * math.sin(phi)
        cx = int((qx + OFF) // 2)
        cy = int((qy + OFF) // 2)
        self.PEN[max(cy - 3, 0):cy + 4, max(cx - 3, 0):cx + 4] += 10.0

    def cpu_ok(self):
        used = time.process_time() - T_START
        return used + 1.3 * self.t_plan < 1.5 + 0.0175 * self.n

    def act(self, obs):
        pose = obs["pose"]
        x = float(pose[0])
        y = float(pose[1])
        th = float(pose[2])
        self.sense(x, y, th, obs["ranges"])
        self.n += 1
        if self.relax > 0:
            self.relax -= 1

        # replanning
        since = self.n - self.last_plan
        every = min(max(int(self.t_plan / 0.009) + 1, 3), 30)
        if (since >= every or (self.force and since >= 2)) and (self.cpu_ok() or not self.have_path and since >= 20):
            t0 = time.process_time()
            try:
                self.plan(x, y)
            except (ValueError, IndexError, TypeError, ArithmeticError) as err:
                self.errors += 1
                self.last_error = str(err)
            dt = time.process_time() - t0
            self.t_plan = 0.5 * self.t_plan + 0.5 * dt
            self.last_plan = self.n
            self.force = False

        self.px, self.py = self.local_points(x, y, 27)
        c0 = float(self.clear(np.array([x]), np.array([y]))[0])

        tx, ty, visible = self.pick_target(x, y)
        if not visible:
            self.force = True
        phi_t = math.atan2(ty - y, tx - x)
        dist_t = math.hypot(tx - x, ty - y)

        # stuck?
        self.hist.append((x, y))
        if len(self.hist) == 40:
            ox, oy = self.hist[0]
            if math.hypot(x - ox, y - oy) < 5.0:
                self.penalise(x, y, phi_t)
                self.relax = 40
                self.force = True
                self.no_keep = True
                self.hist.clear()

        hard = 8.62 if self.relax > 0 else 8.75
        tol = 0.05 if self.relax > 0 else 0.02

        # choose the direction
        ts = np.minimum(T_CAND, max(dist_t, 3.0))
        dirs = phi_t + DELTAS
        qx = x + np.cos(dirs)[:, None] * ts
        qy = y + np.sin(dirs)[:, None] * ts
        cl = self.clear(qx, qy)
        m = cl.min(axis=1)
        ok = (m >= hard) | ((m >= c0 - tol) & (cl[:, 2] > c0 + 0.15))
        phi = phi_t
        free = True
        if ok.any():
            turn_need = np.abs((dirs - th + math.pi) % (2.0 * math.pi) - math.pi)
            score = np.abs(DELTAS) + 3.0 * np.maximum(0.0, 9.25 - m) ** 2 + 0.15 * turn_need
            score = np.where(ok, score, 1e9)
            k = int(np.argmin(score))
            phi = float(dirs[k])
            if abs(float(DELTAS[k])) > 0.4:
                self.force = True
        else:
            self.force = True
            t2 = np.array([1.0, 2.0, 3.0])
            qx = x + np.cos(ALL_DIRS)[:, None] * t2
            qy = y + np.sin(ALL_DIRS)[:, None] * t2
            cl2 = self.clear(qx, qy)
            gain = cl2.min(axis=1) + 0.5 * cl2[:, 2]
            k = int(np.argmax(gain))
            if c0 < 9.3 and float(cl2[k].min()) > c0 + 0.02:
                phi = float(ALL_DIRS[k])
            else:
                free = False

        e = wrap(phi - th)
        if not free:
            self.blocked += 1
            if self.blocked >= 5:
                self.blocked = 0
                self.penalise(x, y, phi_t)
                self.relax = 30
                self.no_keep = True
            d = min(max(7.5 * e, -2.0), 2.0)
            return 0.5 * d, -0.5 * d

        gain = 1.0 if abs(e) > 0.05 else 0.5
        d = min(max(7.5 * e * gain, -2.0), 2.0)
        v = 1.0 - 0.5 * abs(d)
        need = min(hard - 0.03, c0 - tol)
        if v > 0.01:
            for sc in (1.0, 0.6, 0.3):
                vv = v * sc
                left = vv + 0.5 * d
                right = vv - 0.5 * d
                if self.arc_clear(x, y, th, left, right) >= need:
                    self.blocked = max(self.blocked - 1, 0)
                    return left, right
        d = min(max(7.5 * e, -2.0), 2.0)
        if abs(e) < 0.03:
            self.blocked += 1
            self.force = True
            if self.blocked >= 5:
                self.blocked = 0
                self.penalise(x, y, phi)
                self.relax = 30
                self.no_keep = True
        return 0.5 * d, -0.5 * d


STATE = {"nav": None}


def reset(obs):
    STATE["nav"] = Nav(obs)


def policy(obs):
    nav = STATE["nav"]
    if nav is None:
        nav = Nav(obs)
        STATE["nav"] = nav
    try:
        left, right = nav.act(obs)
    except (ValueError, IndexError, TypeError, ArithmeticError) as err:
        nav.errors += 1
        nav.last_error = str(err)
        left, right = 0.5, -0.5
    left = float(left)
    right = float(right)
    if not (math.isfinite(left) and math.isfinite(right)):
        left, right = 0.5, -0.5
    return min(max(left, -1.0), 1.0), min(max(right, -1.0), 1.0)
