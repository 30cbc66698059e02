import math
import time
import heapq
import numpy as np

RAD = 8.0
AX = 9.0
VM = 3.0
NR = 72
ANG = np.radians(-177.5 + np.arange(NR) * 5.0)
G = 1000
OFF = 500
OCC = 0.5
HITMAX = 119.5
TS = np.arange(1.0, 120.0)
_b = np.arange(-7, 8)
BX, BY = np.meshgrid(_b, _b)
_m = (BX * BX + BY * BY) <= 7.0 * 7.0
BX = BX[_m]
BY = BY[_m]
TI = np.arange(1, 7) / 7.0
HOR = 20
LW = 90
EDR = 15
Q = 4
NEX = 6


def wrap(a):
    return (a + math.pi) % (2 * math.pi) - math.pi


def cell(v):
    return np.clip(np.floor(v + 0.5).astype(np.int64) + OFF, 2, G - 3)


def edt2(occ, R):
    big = np.float32((R + 1) ** 2)
    f = np.where(occ, np.float32(0), big)
    g = f.copy()
    for k in range(1, R + 1):
        t = f + np.float32(k * k)
        np.minimum(g[:, k:], t[:, :-k], out=g[:, k:])
        np.minimum(g[:, :-k], t[:, k:], out=g[:, :-k])
    d = g.copy()
    for k in range(1, R + 1):
        t = g + np.float32(k * k)
        np.minimum(d[k:], t[:-k], out=d[k:])
        np.minimum(d[:-k], t[k:], out=d[:-k])
    return np.minimum(d, big)


class Track:
    def __init__(self, x, y, r):
        self.x = x
        self.y = y
        self.r = r
        self.nr = 1
        self.vx = 0.0
        self.vy = 0.0
        self.nvx = 0.0
        self.nvy = 0.0
        self.px1 = x
        self.py1 = y
        self.ox = x
        self.oy = y
        self.speed = None
        self.seen = 1
        self.unseen = 0
        self.slow = 0

    def observe(self, x, y, px, py, strong, r=None):
        # px, py: position one step ago
        nvx, nvy = x - px, y - py
        sp = math.hypot(nvx, nvy)
        if self.seen == 1:
            self.vx, self.vy = nvx, nvy
            if sp > 3.3:
                self.vx *= 3.0 / sp
                self.vy *= 3.0 / sp
            self.speed = min(3.0, sp)
        elif strong:
            dv = math.hypot(nvx - self.vx, nvy - self.vy)
            if dv < 0.25:
                a = 0.4
                self.vx += a * (nvx - self.vx)
                self.vy += a * (nvy - self.vy)
                self.speed = 0.8 * self.speed + 0.2 * sp
            elif abs(sp - self.speed) < 0.35 or self.seen < 4:
                self.vx, self.vy = nvx, nvy
                self.speed = min(3.05, 0.5 * self.speed + 0.5 * sp)
            elif sp > 1e-6:
                # a bounce within the step: direction half known
                k = self.speed / sp
                self.vx, self.vy = nvx * k, nvy * k
        else:
            self.vx += 0.15 * (nvx - self.vx)
            self.vy += 0.15 * (nvy - self.vy)
        if r is not None:
            self.nr += 1
            self.r += (r - self.r) / min(self.nr, 6)
        self.x, self.y = x, y
        self.seen += 1
        self.unseen = 0
        if math.hypot(self.vx, self.vy) < 0.45:
            self.slow += 1
        else:
            self.slow = 0


class Ctl:
    def __init__(self, obs):
        g = obs['goal']
        self.gx, self.gy = float(g[0]), float(g[1])
        self.L = np.zeros((G, G), np.float32)
        self.n = 0
        self.tracks = []
        self.b = [-20.0, 20.0, -20.0, 20.0]
        self.V = None
        self.last_plan = -100
        self.last_ok = 0
        self.rng = np.random.default_rng(7)
        self.best = None
        self.D = None
        self.err = 0
        self.scans = []
        self.npx = np.zeros(0)
        self.npy = np.zeros(0)

    def slack(self):
        return 2.0 + 0.02 * self.n - time.process_time()

    # ---------------------------------------------------------------- discs
    def detect(self, r, x, y, ang, ex, ey, hit, dyn):
        i = np.arange(NR)
        j = (i + 1) % NR
        k = (i + 2) % NR
        bx, by = ex[j] - ex, ey[j] - ey
        cx, cy = ex[k] - ex, ey[k] - ey
        D = 2 * (bx * cy - by * cx)
        ok = hit & hit[j] & hit[k] & (np.abs(D) > 1e-4)
        Dd = np.where(ok, D, 1.0)
        b2 = bx * bx + by * by
        c2 = cx * cx + cy * cy
        ux = (cy * b2 - by * c2) / Dd
        uy = (bx * c2 - cx * b2) / Dd
        rad = np.hypot(ux, uy)
        ccx = ex + ux
        ccy = ey + uy
        dc = np.hypot(ccx - x, ccy - y)
        ok &= (rad > 4.7) & (rad < 9.3) & (dc > rad + 7.5)
        tl = np.sqrt(np.maximum(dc * dc - rad * rad, 0.0)) + 0.05
        ok &= (r <= tl) & (r[j] <= tl) & (r[k] <= tl)
        idx = np.nonzero(ok)[0]
        if len(idx) == 0:
            return []
        ca = np.arctan2(ccy[idx] - y, ccx[idx] - x)
        df = ang[None, :] - ca[:, None]
        al = dc[idx][:, None] * np.cos(df)
        pb = dc[idx][:, None] * np.sin(df)
        disc = (rad[idx] ** 2)[:, None] - pb * pb
        ins = (disc > 0) & (al > 0)
        pr = al - np.sqrt(np.maximum(disc, 0.0))
        res = r[None, :] - pr
        sup = ins & (np.abs(res) < 0.12)
        con = (disc > 1.0) & (al > 0) & (res > 0.4)
        ns = sup.sum(axis=1)
        nc = con.sum(axis=1)
        cand = []
        for a in range(len(idx)):
            if nc[a] > 0:
                continue
            q = int(idx[a])
            c0, c1, rr = float(ccx[q]), float(ccy[q]), float(rad[q])
            good = ns[a] >= 4
            if not good and ns[a] >= 3:
                if int((dyn & sup[a]).sum()) >= 2:
                    good = True
                else:
                    for t in self.tracks:
                        if math.hypot(t.px1 - c0, t.py1 - c1) < 1.5 and abs(t.r - rr) < 0.7:
                            good = True
            if good:
                cand.append((int(ns[a]), c0, c1, rr, sup[a]))
        cand.sort(key=lambda z: -z[0])
        out = []
        for c in cand:
            if all(math.hypot(c[1] - o[1], c[2] - o[2]) > 5.0 for o in out):
                out.append(c)
        return out

    def update_tracks(self, r, x, y, ang, ex, ey, hit, dyn):
        for t in self.tracks:
            t.ox, t.oy = t.x, t.y
            t.px1, t.py1 = t.x + t.vx, t.y + t.vy
            t.nvx, t.nvy = t.vx, t.vy
        if self.tracks and self.D is not None:
            P, _ = self.predict(self.tracks, 1)
            for i, t in enumerate(self.tracks):
                t.px1, t.py1 = float(P[1, i, 0]), float(P[1, i, 1])
        det = self.detect(r, x, y, ang, ex, ey, hit, dyn)
        used = np.zeros(NR, bool)
        pairs = []
        for di, d in enumerate(det):
            for ti, t in enumerate(self.tracks):
                e = min(math.hypot(t.px1 - d[1], t.py1 - d[2]),
                        math.hypot(t.x + t.vx - d[1], t.y + t.vy - d[2]) + 0.05)
                gate = 3.6 if t.seen < 2 else 2.2 + 0.6 * min(t.unseen, 6)
                if t.seen >= 2 and math.hypot(t.x - d[1], t.y - d[2]) < 3.4:
                    gate = max(gate, 6.0)
                if e < gate and abs(d[3] - t.r) < 2.5:
                    pairs.append((e + abs(d[3] - t.r), di, ti))
        pairs.sort()
        du = set()
        tu = set()
        for _, di, ti in pairs:
            if di in du or ti in tu:
                continue
            du.add(di)
            tu.add(ti)
            d = det[di]
            t = self.tracks[ti]
            if t.unseen > 0:
                # position history is a guess: refresh the velocity softly
                f = 1.0 / (t.unseen + 1)
                vx = t.vx + (d[1] - t.px1) * f
                vy = t.vy + (d[2] - t.py1) * f
                t.observe(d[1], d[2], d[1] - vx, d[2] - vy, True, d[3])
            else:
                t.observe(d[1], d[2], t.ox, t.oy, True, d[3])
            used |= d[4]
        keep = []
        for ti, t in enumerate(self.tracks):
            if ti not in tu:
                cx, cy = t.px1, t.py1
                dcx, dcy = cx - x, cy - y
                dc = math.hypot(dcx, dcy)
                e = np.hypot(ex - cx, ey - cy) - t.r
                near = hit & ~used & (np.abs(e) < 1.3) & (r < math.sqrt(max(dc * dc - t.r * t.r, 1.0)) + 1.5)
                df = ang - math.atan2(dcy, dcx)
                disc = t.r * t.r - (dc * np.sin(df)) ** 2
                pr = dc * np.cos(df) - np.sqrt(np.maximum(disc, 0.0))
                con = (disc > 2.0) & (np.cos(df) > 0) & (r > pr + 1.6)
                if near.any() and not con.any():
                    qx, qy = ex[near], ey[near]
                    for _ in range(3):
                        u0 = qx - cx
                        u1 = qy - cy
                        dd = np.maximum(np.hypot(u0, u1), 1e-6)
                        u0 = u0 / dd
                        u1 = u1 / dd
                        ee = dd - t.r
                        a00 = float((u0 * u0).sum()) + 0.15
                        a11 = float((u1 * u1).sum()) + 0.15
                        a01 = float((u0 * u1).sum())
                        b0 = float((u0 * ee).sum()) - 0.15 * (cx - t.px1)
                        b1 = float((u1 * ee).sum()) - 0.15 * (cy - t.py1)
                        de = a00 * a11 - a01 * a01
                        cx += (a11 * b0 - a01 * b1) / de
                        cy += (a00 * b1 - a01 * b0) / de
                    t.observe(cx, cy, t.ox, t.oy, False)
                    used |= near
                else:
                    t.x, t.y = t.px1, t.py1
                    t.vx, t.vy = t.nvx, t.nvy
                    t.unseen += 3 if con.any() else 1
            if t.unseen > 14 or (t.seen < 3 and t.unseen > 3):
                continue
            if t.slow >= 4:
                continue
            keep.append(t)
        self.tracks = keep
        for di, d in enumerate(det):
            if di not in du:
                self.tracks.append(Track(d[1], d[2], d[3]))
                used |= d[4]
        return used

    def look(self, X, Y):
        h, w = self.D.shape
        ix = np.clip(np.floor(X + 0.5).astype(np.int64) - self.dx0, 0, w - 1)
        iy = np.clip(np.floor(Y + 0.5).astype(np.int64) - self.dy0, 0, h - 1)
        return self.D[iy, ix]

    def predict(self, tr, H):
        n = len(tr)
        P = np.zeros((H + 1, n, 2))
        Gr = np.zeros((H + 1, n))
        X = np.array([t.x for t in tr])
        Y = np.array([t.y for t in tr])
        VX = np.array([t.vx for t in tr])
        VY = np.array([t.vy for t in tr])
        R = np.array([t.r for t in tr])
        rate = np.array([0.9 if t.seen < 2 else (0.15 if t.seen < 4 or t.unseen > 0 else 0.03) for t in tr])
        cap = np.array([8.0 if t.seen < 2 else 3.0 for t in tr])
        g = np.array([min(3.0, 0.4 * t.unseen) for t in tr])
        P[0, :, 0] = X
        P[0, :, 1] = Y
        Gr[0] = g
        for k in range(1, H + 1):
            NX = X + VX
            NY = Y + VY
            c = self.look(NX, NY)
            b = c < R - 0.2
            if b.any():
                gx = self.look(NX + 2, NY) - self.look(NX - 2, NY)
                gy = self.look(NX, NY + 2) - self.look(NX, NY - 2)
                nn = np.hypot(gx, gy)
                okn = b & (nn > 0.3)
                nd = np.where(nn > 0.3, nn, 1.0)
                gx = gx / nd
                gy = gy / nd
                vn = VX * gx + VY * gy
                f = okn & (vn < 0)
                VX = np.where(f, VX - 2 * vn * gx, VX)
                VY = np.where(f, VY - 2 * vn * gy, VY)
                pen = np.where(f, np.maximum(0.0, R - c), 0.0)
                NX = np.where(f, NX + 2 * np.minimum(pen, 1.5) * gx, NX)
                NY = np.where(f, NY + 2 * np.minimum(pen, 1.5) * gy, NY)
                rate = np.where(f, np.maximum(rate, 0.22), rate)
            X, Y = NX, NY
            g = np.minimum(g + rate, np.maximum(cap, g))
            P[k, :, 0] = X
            P[k, :, 1] = Y
            Gr[k] = g
            if k == 1:
                for i, t in enumerate(tr):
                    t.nvx, t.nvy = float(VX[i]), float(VY[i])
        return P, Gr

    # ---------------------------------------------------------------- static map
    def insert(self, r, x, y, ca, sa, ex, ey, hit, used):
        L = self.L
        msk = TS[None, :] < (r - 1.5)[:, None]
        fx = (x + TS[None, :] * ca[:, None])[msk]
        fy = (y + TS[None, :] * sa[:, None])[msk]
        ix = cell(fx)
        iy = cell(fy)
        v = L[iy, ix]
        L[iy, ix] = np.maximum(v - np.where(v > 4.0, np.float32(0.3), np.float32(0.7)), -3.0)
        bx = int(math.floor(x + 0.5)) + OFF + BX
        by = int(math.floor(y + 0.5)) + OFF + BY
        L[by, bx] = np.minimum(L[by, bx], -1.0)
        b = self.b
        b[0] = min(b[0], float(ex.min()))
        b[1] = max(b[1], float(ex.max()))
        b[2] = min(b[2], float(ey.min()))
        b[3] = max(b[3], float(ey.max()))
        st = hit & ~used
        nx = np.roll(ex, -1)
        ny = np.roll(ey, -1)
        dd = np.hypot(nx - ex, ny - ey)
        two = st & np.roll(st, -1) & (dd > 1.3) & (dd < 7.0)
        if two.any():
            mx = (ex[two][:, None] + (nx - ex)[two][:, None] * TI[None, :]).ravel()
            my = (ey[two][:, None] + (ny - ey)[two][:, None] * TI[None, :]).ravel()
            jx, jy = cell(mx), cell(my)
            k = L[jy, jx] > -0.5
            jx, jy = jx[k], jy[k]
            L[jy, jx] = np.minimum(L[jy, jx] + np.float32(0.8), 8.0)
        if st.any():
            jx, jy = cell(ex[st]), cell(ey[st])
            np.add.at(L, (jy, jx), np.float32(2.0))
            L[jy, jx] = np.minimum(L[jy, jx], 8.0)

    def near_points(self, r, x, y, ex, ey, hit, used, dyn):
        # exact wall points around the robot: this scan, the last ones, and guesses at corners
        cur = hit & ~used & (r < 36.0)
        nxt = np.roll(cur, -1)
        dx = np.roll(ex, -1) - ex
        dy = np.roll(ey, -1) - ey
        dd = np.hypot(dx, dy)
        xs = [ex[cur]]
        ys = [ey[cur]]
        a = cur & nxt & (dd < 6.0)
        xs.append(ex[a] + 0.5 * dx[a])
        ys.append(ey[a] + 0.5 * dy[a])
        a = cur & nxt & (dd < 3.0)
        xs.append(ex[a] - 0.5 * dx[a])
        ys.append(ey[a] - 0.5 * dy[a])
        xs.append(ex[a] + 1.5 * dx[a])
        ys.append(ey[a] + 1.5 * dy[a])
        for sx, sy in self.scans:
            xs.append(sx)
            ys.append(sy)
        X = np.concatenate(xs)
        Y = np.concatenate(ys)
        k = (X - x) ** 2 + (Y - y) ** 2 < 29.0 ** 2
        X, Y = X[k], Y[k]
        if len(X):
            # thin out to one point per half pixel
            key = np.round(X * 2).astype(np.int64) * 100003 + np.round(Y * 2).astype(np.int64)
            _, u = np.unique(key, return_index=True)
            X, Y = X[u], Y[u]
        self.npx, self.npy = X, Y
        st = cur & ~dyn
        self.scans.append((ex[st], ey[st]))
        if len(self.scans) > 6:
            self.scans.pop(0)

    def local(self, x, y):
        cx = int(math.floor(x + 0.5)) + OFF
        cy = int(math.floor(y + 0.5)) + OFF
        x0 = max(0, min(G - 2 * LW - 1, cx - LW))
        y0 = max(0, min(G - 2 * LW - 1, cy - LW))
        occ = self.L[y0:y0 + 2 * LW + 1, x0:x0 + 2 * LW + 1] > OCC
        self.D = np.sqrt(edt2(occ, EDR))
        self.dx0 = x0 - OFF
        self.dy0 = y0 - OFF

    # ---------------------------------------------------------------- global plan
    def plan(self, x, y):
        b = self.b
        mg = 24
        x0 = int(max(-OFF + 4, min(b[0], self.gx, x) - mg))
        x1 = int(min(OFF - 4, max(b[1], self.gx, x) + mg))
        y0 = int(max(-OFF + 4, min(b[2], self.gy, y) - mg))
        y1 = int(min(OFF - 4, max(b[3], self.gy, y) + mg))
        w = (x1 - x0) // Q
        h = (y1 - y0) // Q
        Lw = self.L[y0 + OFF:y0 + OFF + h * Q, x0 + OFF:x0 + OFF + w * Q]
        d = np.sqrt(edt2(Lw > OCC, EDR))
        c = d[Q // 2::Q, Q // 2::Q]
        unk = np.abs(Lw[Q // 2::Q, Q // 2::Q]) < 0.05
        cost = (1.0 + 1.2 * np.clip((14.0 - c) / 5.0, 0, 1)) * np.where(unk, 1.12, 1.0)
        gj = min(w - 2, max(1, int((self.gx - x0) // Q)))
        gi = min(h - 2, max(1, int((self.gy - y0) // Q)))
        rj = min(w - 2, max(1, int((x - x0) // Q)))
        ri = min(h - 2, max(1, int((y - y0) // Q)))
        ok = False
        for thr in (8.8, 7.5, 6.0):
            cc = np.where(c >= thr, cost, 0.0)
            cc[max(0, gi - 1):gi + 2, max(0, gj - 1):gj + 2] = np.maximum(
                cc[max(0, gi - 1):gi + 2, max(0, gj - 1):gj + 2], 1.0)
            blk = cc[max(0, ri - 1):ri + 2, max(0, rj - 1):rj + 2]
            cc[max(0, ri - 1):ri + 2, max(0, rj - 1):rj + 2] = np.where(blk == 0, 6.0, blk)
            cc[0, :] = 0
            cc[-1, :] = 0
            cc[:, 0] = 0
            cc[:, -1] = 0
            gs, par, ok = self.dijkstra(cc.ravel().tolist(), w, gi * w + gj, ri * w + rj)
            if ok or self.slack() < 0.6:
                break
        if not ok and self.V is not None and self.n - self.last_ok < 40:
            return
        self.last_ok = self.n
        V = np.array(gs).reshape(h, w)
        bad = V > 1e8
        if bad.all():
            return
        top = float(V[~bad].max()) + 120.0
        V[bad] = 1e9
        for _ in range(3):
            m = np.full((h, w), 1e9)
            m[1:] = np.minimum(m[1:], V[:-1])
            m[:-1] = np.minimum(m[:-1], V[1:])
            m[:, 1:] = np.minimum(m[:, 1:], V[:, :-1])
            m[:, :-1] = np.minimum(m[:, :-1], V[:, 1:])
            V = np.where(bad, np.minimum(V, m + 12.0), V)
        V = np.minimum(V, top)
        par = np.array(par)
        p = par
        for _ in range(4):
            p = par[p]
        me = np.arange(h * w)
        vx = (p % w) - (me % w)
        vy = (p // w) - (me // w)
        A = np.arctan2(vy, vx).reshape(h, w)
        PX = x0 + Q * np.arange(w)[None, :] + Q / 2
        PY = y0 + Q * np.arange(h)[:, None] + Q / 2
        dgx = self.gx - PX
        dgy = self.gy - PY
        direct = bad | ((vx == 0) & (vy == 0)).reshape(h, w) | (dgx * dgx + dgy * dgy < 14.0 ** 2)
        A = np.where(direct, np.arctan2(dgy + 0 * dgx, dgx + 0 * dgy), A)
        self.V = V
        self.A = A
        self.par = par
        self.vx0 = x0
        self.vy0 = y0

    def dijkstra(self, cost, w, g, rob):
        n = len(cost)
        gs = [1e9] * n
        par = list(range(n))
        closed = bytearray(n)
        nb = ((1, 4.0), (-1, 4.0), (w, 4.0), (-w, 4.0), (w + 1, 5.65685), (w - 1, 5.65685),
              (-w + 1, 5.65685), (-w - 1, 5.65685))
        gs[g] = 0.0
        heap = [(0.0, g)]
        pop = heapq.heappop
        push = heapq.heappush
        lim = 1e9
        ok = False
        while heap:
            gu, u = pop(heap)
            if closed[u]:
                continue
            if gu > lim:
                break
            closed[u] = 1
            if u == rob:
                lim = gu + 110.0
                ok = True
            cu = cost[u] or 1.0
            for of, l in nb:
                v = u + of
                c = cost[v]
                if c == 0.0 or closed[v]:
                    continue
                ng = gu + l * (c + cu) * 0.5
                if ng < gs[v]:
                    gs[v] = ng
                    par[v] = u
                    push(heap, (ng, v))
        return gs, par, ok

    def vlook(self, X, Y):
        V = self.V
        h, w = V.shape
        fx = np.clip((X - self.vx0 - Q / 2) / Q, 0, w - 1.001)
        fy = np.clip((Y - self.vy0 - Q / 2) / Q, 0, h - 1.001)
        i = fx.astype(np.int64)
        j = fy.astype(np.int64)
        a = fx - i
        b = fy - j
        i1 = np.minimum(i + 1, w - 1)
        j1 = np.minimum(j + 1, h - 1)
        return ((V[j, i] * (1 - a) + V[j, i1] * a) * (1 - b) + (V[j1, i] * (1 - a) + V[j1, i1] * a) * b)

    def alook(self, X, Y):
        h, w = self.A.shape
        i = np.clip(((X - self.vx0) // Q).astype(np.int64), 0, w - 1)
        j = np.clip(((Y - self.vy0) // Q).astype(np.int64), 0, h - 1)
        return self.A[j, i]

    def ahead(self, x, y):
        # points further along the path: (angle, distance)
        h, w = self.V.shape
        i = min(w - 1, max(0, int((x - self.vx0) // Q)))
        j = min(h - 1, max(0, int((y - self.vy0) // Q)))
        p = j * w + i
        out = []
        for k in range(1, 25):
            q = int(self.par[p])
            if q == p:
                break
            p = q
            if k in (4, 7, 10, 14, 19, 24):
                out.append((self.vx0 + Q * (p % w) + Q / 2, self.vy0 + Q * (p // w) + Q / 2))
        if math.hypot(self.gx - x, self.gy - y) < 90:
            out.append((self.gx, self.gy))
        return [(math.atan2(b - y, a - x), math.hypot(a - x, b - y)) for a, b in out]

    # ---------------------------------------------------------------- local plan
    def sample(self, C, psi, ahead):
        g = self.rng
        p1 = np.where(g.random(C) < 0.5, psi + g.normal(0, 0.6, C), g.uniform(-math.pi, math.pi, C))
        p2 = np.where(g.random(C) < 0.4, psi + g.normal(0, 0.7, C), g.uniform(-math.pi, math.pi, C))
        u = g.random(C)
        s1 = np.where(u < 0.6, 1.0, np.where(u < 0.72, 0.0, g.random(C)))
        u = g.random(C)
        s2 = np.where(u < 0.6, 1.0, np.where(u < 0.75, 0.0, g.random(C)))
        t1 = g.integers(1, 10, C)
        t2 = np.where(g.random(C) < 0.45, 0, g.integers(1, 12, C))
        s3 = np.where(g.random(C) < 0.75, 1.0, g.random(C))
        S = np.stack([p1, s1, t1, p2, s2, t2, s3], axis=1).astype(float)
        S[0] = [psi, 1, 0, psi, 1, 0, 1.0]      # follow the field
        S[1] = [psi, 0, 30, psi, 0, 0, 0.0]     # stand
        S[2] = [psi, 1, 30, psi, 1, 0, 1.0]
        S[3] = [psi, 1, 0, psi, 1, 0, 0.6]
        S[4] = [psi, 0, 4, psi, 0, 0, 1.0]
        S[5] = [psi, 0, 8, psi, 0, 0, 1.0]
        if self.best is not None:
            B = self.best.copy()
            if B[2] > 0:
                B[2] -= 1
            elif B[5] > 0:
                B[5] -= 1
            S[6] = B
            m = min(40, C - 7)
            S[7:7 + m] = B
            S[7:7 + m, 0] += g.normal(0, 0.25, m)
            S[7:7 + m, 3] += g.normal(0, 0.35, m)
            S[7:7 + m, 2] = np.maximum(0, S[7:7 + m, 2] + g.integers(-1, 2, m))
            S[7:7 + m, 5] = np.maximum(0, S[7:7 + m, 5] + g.integers(-1, 2, m))
        k = 48
        for a, d in ahead:
            if d < 3.0:
                continue
            n = d / 3.0
            S[k] = [a, 1, math.ceil(n), psi, 1, 0, 1.0]
            S[k + 1] = [a, 1, max(1, int(0.5 * n)), psi, 1, 0, 1.0]
            k += 2
        return S

    def choose(self, x, y, th, ghosts):
        H = HOR
        C = 320 if self.slack() > 0.6 else 140
        psi = float(self.alook(np.array([x]), np.array([y]))[0])
        S = self.sample(C, psi, self.ahead(x, y))
        tr = self.tracks + ghosts
        near = []
        for t in tr:
            if math.hypot(t.x - x, t.y - y) < 135:
                near.append(t)
        if near:
            P, Gr = self.predict(near, H)
            R = np.array([t.r for t in near]) + RAD
        X = np.full(C, x)
        Y = np.full(C, y)
        T = np.full(C, th)
        pen = np.zeros(C)
        tc = np.full(C, 1000.0)
        reach = np.full(C, 1000.0)
        c0 = float(self.look(np.array([x]), np.array([y]))[0])
        hard = min(8.9, c0 - 0.15)
        npx, npy = self.npx, self.npy
        exact = len(npx) > 0
        hex_ = 8.6
        if exact:
            e0 = math.sqrt(float(((npx - x) ** 2 + (npy - y) ** 2).min()))
            if e0 < 8.65:
                hex_ = max(min(8.15, e0), e0 - 0.03)
        a1 = S[:, 2]
        a2 = S[:, 2] + S[:, 5]
        firstv = None
        for k in range(1, H + 1):
            ph1 = (k - 1) < a1
            ph2 = (~ph1) & ((k - 1) < a2)
            ps = np.where(ph1, S[:, 0], np.where(ph2, S[:, 3], self.alook(X, Y)))
            sp = np.where(ph1, S[:, 1], np.where(ph2, S[:, 4], S[:, 6]))
            er = (ps - T + math.pi) % (2 * math.pi) - math.pi
            rev = np.abs(er) > math.pi / 2 + 0.05
            er = np.where(rev, np.where(er > 0, er - math.pi, er + math.pi), er)
            sg = np.where(rev, -1.0, 1.0)
            tu = np.where(sp < 0.02, 0.0, np.clip(er, -0.62, 0.62))
            v = sg * np.minimum(VM * sp, VM - AX / 2 * np.abs(tu))
            if k == 1:
                firstv = (v.copy(), tu.copy())
            mid = T + tu / 2
            X = X + v * np.cos(mid)
            Y = Y + v * np.sin(mid)
            T = T + tu
            act = (tc > 900) & (reach > 900)
            mv = np.abs(v) > 1e-6
            c = self.look(X, Y)
            if k <= NEX:
                viol = (c < min(7.5, hard)) & mv
                if exact:
                    d2 = (X[:, None] - npx[None, :]) ** 2
                    d2 += (Y[:, None] - npy[None, :]) ** 2
                    ce = np.sqrt(d2.min(axis=1))
                    viol |= (ce < hex_) & mv
                    c = np.minimum(c, ce)
            else:
                viol = (c < hard) & mv
            wgt = math.exp(-k / 8.0)
            pen += np.where(act & mv, 0.25 * np.maximum(0.0, 11.0 - c) ** 2 * (0.3 + wgt), 0.0)
            if near:
                dx = X[:, None] - P[k, :, 0][None, :]
                dy = Y[:, None] - P[k, :, 1][None, :]
                dist = np.sqrt(dx * dx + dy * dy) - R[None, :]
                hm = (dist - 0.5 * Gr[k][None, :]).min(axis=1)
                sm = (dist - Gr[k][None, :]).min(axis=1)
                # discs one step earlier, in case the order of motion matters
                if k <= 6:
                    dx = X[:, None] - P[k - 1, :, 0][None, :]
                    dy = Y[:, None] - P[k - 1, :, 1][None, :]
                    d1 = (np.sqrt(dx * dx + dy * dy) - R[None, :]).min(axis=1)
                    hm = np.minimum(hm, d1 + 0.3)
                viol |= hm < 0.8
                pen += np.where(act, 0.9 * np.maximum(0.0, 4.5 - sm) ** 2 * wgt, 0.0)
            tc = np.where(act & viol, k, tc)
            dg = np.hypot(X - self.gx, Y - self.gy)
            reach = np.where(act & ~viol & (dg < 3.7), k, reach)
        J = self.vlook(X, Y)
        J = np.where(reach < 900, -3.0 * (H - reach) - 20.0, J)
        J = J + pen
        col = tc < 900
        J = J + np.where(col, 150.0 + 3000.0 * np.exp(-np.minimum(tc, 60) / 5.0), 0.0)
        k = int(np.argmin(J))
        self.best = S[k]
        v = float(firstv[0][k])
        t = float(firstv[1][k])
        return (v + t * AX / 2) / VM, (v - t * AX / 2) / VM

    def step(self, obs):
        self.n += 1
        p = obs['pose']
        x, y, th = float(p[0]), float(p[1]), float(p[2])
        r = np.asarray(obs['ranges'], dtype=np.float64)
        ang = ANG + th
        ca = np.cos(ang)
        sa = np.sin(ang)
        ex = x + r * ca
        ey = y + r * sa
        hit = r < HITMAX
        ix = cell(ex)
        iy = cell(ey)
        m = self.L[iy, ix].copy()
        dyn = hit & (m < -1.0)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)):
            dyn &= self.L[iy + dy, ix + dx] < 0.3
        used = self.update_tracks(r, x, y, ang, ex, ey, hit, dyn)
        self.insert(r, x, y, ca, sa, ex, ey, hit, used)
        self.local(x, y)
        self.near_points(r, x, y, ex, ey, hit, used, dyn)
        # rays on something that moves, but no circle yet
        ghosts = []
        lost = dyn & ~used & (r < 75)
        i = 0
        while i < NR:
            if lost[i]:
                j = i
                k = i
                while j + 1 < NR and lost[j + 1]:
                    j += 1
                    if r[j] < r[k]:
                        k = j
                gx = float(ex[k] + 6.5 * ca[k])
                gy = float(ey[k] + 6.5 * sa[k])
                if all(math.hypot(t.x - gx, t.y - gy) > 9 for t in self.tracks):
                    ghosts.append(Track(gx, gy, 6.5))
                i = j
            i += 1
        sl = self.slack()
        iv = 5 if sl > 1.0 else (9 if sl > 0.5 else 25)
        if self.V is None or self.n - self.last_plan >= iv:
            self.plan(x, y)
            self.last_plan = self.n
        if self.V is None:
            return 0.0, 0.0
        return self.choose(x, y, th, ghosts)


CTL = None


def reset(obs):
    global CTL
    CTL = Ctl(obs)


def policy(obs):
    global CTL
    if CTL is None:
        CTL = Ctl(obs)
    try:
        a = CTL.step(obs)
        l, r = float(a[0]), float(a[1])
        if not (math.isfinite(l) and math.isfinite(r)):
            l, r = 0.0, 0.0
        CTL.err = 0
    except (ValueError, IndexError, ZeroDivisionError, AttributeError):
        CTL.err += 1
        if CTL.err > 15:
            raise
        l, r = 0.0, 0.0
    return max(-1.0, min(1.0, l)), max(-1.0, min(1.0, r))
