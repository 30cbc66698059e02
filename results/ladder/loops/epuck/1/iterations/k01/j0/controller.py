import math
import heapq
import time
from collections import deque
import numpy as np

RW = 0.02
AXLE = 0.052
SMAX = 0.01256            # m per step at full speed
KT = SMAX / AXLE          # turn per step for right - left = 1
RAD = 0.037
DT = 0.1
CELL = 0.0125
N = 480                   # plan grid: +-3 m
HALF = 3.0
SC = 0.01                 # grid of verified floor
NS = 620
SHALF = 3.1
FAR = 0.0875
WR = 7                    # stamp window in cells
CT = math.cos(0.16)
INF = 1e18
S2 = math.sqrt(2.0)

SX = np.array([0.03, 0.022, 0.0, -0.03, -0.03, 0.0, 0.022, 0.03])
SY = np.array([-0.01, -0.025, -0.031, -0.015, 0.015, 0.031, 0.025, 0.01])
SA = np.array([-0.3008, -0.8008, -1.5708, -2.644, 2.6392, 1.5708, 0.7992, 0.2992])
TR = np.array([67.19, 104.09, 120.0, 158.03, 234.93, 383.84, 601.46, 1465.73, 2133.33, 4095.0])
TL = np.array([70.0, 60.0, 50.0, 40.0, 30.0, 20.0, 15.0, 10.0, 5.0, 0.0]) * 0.001
SAMP = np.arange(0.0, 0.068, 0.005)
GC = (np.arange(N) + 0.5) * CELL - HALF
_d = np.arange(-0.035, 0.0351, 0.007)
_bx, _by = np.meshgrid(_d, _d)
_m = _bx ** 2 + _by ** 2 < 0.036 ** 2
BX = _bx[_m]
BY = _by[_m]


def wrap(a):
    return (a + math.pi) % (2.0 * math.pi) - math.pi


def wrap90(a):
    q = math.pi / 2.0
    return (a + q / 2.0) % q - q / 2.0


def slip_mean(c):
    """Mean factor of a wheel's speed when slip is cut off at full speed."""
    c = abs(c)
    if c < 0.92:
        return 1.0
    t = max(0.0, (1.0 / c - 1.0) / 0.02)
    phi = math.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)
    up = 0.5 * (1.0 - math.erf(t / S2))
    return 1.0 + 0.02 * (-phi + t * up)


def astar(cost, width, start, h, hend, maxexp):
    n = len(cost)
    g = [INF] * n
    par = [-1] * n
    closed = bytearray(n)
    nb = ((1, 1.0), (-1, 1.0), (width, 1.0), (-width, 1.0), (width + 1, S2),
          (width - 1, S2), (1 - width, S2), (-width - 1, S2))
    g[start] = 0.0
    heap = [(h[start], start)]
    count = 0
    push = heapq.heappush
    pop = heapq.heappop
    while heap:
        f, c = pop(heap)
        if closed[c]:
            continue
        closed[c] = 1
        count += 1
        if h[c] <= hend or count > maxexp:
            path = [c]
            while par[c] >= 0:
                c = par[c]
                path.append(c)
            path.reverse()
            return path
        gc = g[c]
        for d, l in nb:
            m = c + d
            cm = cost[m]
            if cm > 1e6 or closed[m]:
                continue
            ng = gc + l * cm
            if ng < g[m] - 1e-9:
                g[m] = ng
                par[m] = c
                push(heap, (ng + h[m], m))
    return None


class Robot:
    def __init__(self, obs):
        self.n = 0
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))
        self.enc = [float(obs["encoders"][0]), float(obs["encoders"][1])]
        # x, y, heading, mean radius error, right - left radius error, axle error, wall direction
        self.s = np.zeros(7)
        self.P = np.diag([0.0, 0.0, 0.0, 0.0041 ** 2, 0.0082 ** 2, 0.0058 ** 2, 10.0])
        self.have_alpha = False
        self.rejected = 0
        self.tracks = {1: deque(), 2: deque(), 5: deque(), 6: deque()}
        self.occ = {}
        self.clear = np.full((N, N), FAR)
        self.seen = np.zeros((NS, NS), dtype=bool)
        self.path = None
        self.pidx = 0
        self.hard = 0.0445
        self.plan_step = -100
        self.plan_time = 0.02
        self.wig = 1.0
        self.blocked = 0
        self.escape = 0
        self.escape_dir = 0.0
        self.hist = deque()
        self.lo = [min(0.0, self.goal[0]), min(0.0, self.goal[1])]
        self.hi = [max(0.0, self.goal[0]), max(0.0, self.goal[1])]
        self.offs = [(0.0, 0.0)]
        for r in (0.07, 0.13, 0.2):
            for k in range(8):
                a = k * math.pi / 4.0
                self.offs.append((r * math.cos(a), r * math.sin(a)))
        self.k = 0

    # ---------------------------------------------------------------- pose
    def predict(self, obs):
        e = [float(obs["encoders"][0]), float(obs["encoders"][1])]
        c = obs["wheel_speeds"]
        dl = (e[0] - self.enc[0]) * RW * slip_mean(float(c[0]))
        dr = (e[1] - self.enc[1]) * RW * slip_mean(float(c[1]))
        self.enc = e
        s = self.s
        dn = 0.5 * (dl + dr)
        tn = (dr - dl) / AXLE
        dist = dn * (1.0 + s[3]) + 0.25 * s[4] * (dr - dl)
        turn = tn * (1.0 + s[3] - s[5]) + s[4] * dn / AXLE
        mid = s[2] + 0.5 * turn
        cm = math.cos(mid)
        sm = math.sin(mid)
        if abs(turn) > 1e-6:
            chord = dist * math.sin(0.5 * turn) / (0.5 * turn)
        else:
            chord = dist
        s[0] += chord * cm
        s[1] += chord * sm
        s[2] += turn
        F = np.eye(7)
        F[0, 2] = -dist * sm
        F[1, 2] = dist * cm
        F[0, 3] = dn * cm
        F[1, 3] = dn * sm
        F[2, 3] = tn
        F[2, 4] = dn / AXLE
        F[2, 5] = -tn
        P = F @ self.P @ F.T
        v = 0.0004 * (dl * dl + dr * dr)
        P[0, 0] += 0.25 * v + 1e-10
        P[1, 1] += 0.25 * v + 1e-10
        P[2, 2] += v / AXLE ** 2 + 1e-8
        self.P = P

    def heading_update(self, direction, sd):
        s = self.s
        if not self.have_alpha:
            self.have_alpha = True
            s[6] = direction
        inn = wrap90(direction - s[6])
        H = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0])
        PH = self.P @ H
        S = float(H @ PH) + sd * sd
        if abs(inn) > min(0.6, 3.0 * math.sqrt(S) + 0.04):
            self.rejected += 1
            if self.rejected >= 4:
                self.rejected = 0
                self.P[2, 2] += 0.15 ** 2
            return
        self.rejected = 0
        K = PH / S
        self.s = s + K * inn
        P = self.P - np.outer(K, PH)
        self.P = 0.5 * (P + P.T)

    def track(self, k, hit, px, py, length):
        q = self.tracks[k]
        if not hit or length > 0.062:
            q.clear()
            return
        if q and math.hypot(q[-1][0] - px, q[-1][1] - py) > 0.03:
            q.clear()
        q.append((px, py))
        if len(q) > 40:
            q.popleft()
        if len(q) < 7 or math.hypot(q[0][0] - px, q[0][1] - py) < 0.08:
            return
        a = np.array(q)
        a = a - a.mean(axis=0)
        n = len(a)
        sxx = float((a[:, 0] ** 2).sum()) / n
        syy = float((a[:, 1] ** 2).sum()) / n
        sxy = float((a[:, 0] * a[:, 1]).sum()) / n
        root = math.sqrt(0.25 * (sxx - syy) ** 2 + sxy * sxy)
        small = max(0.0, 0.5 * (sxx + syy) - root)
        large = 0.5 * (sxx + syy) + root
        if small > 0.0025 ** 2 or large < 0.02 ** 2:
            for _ in range(len(q) // 2):
                q.popleft()
            return
        direction = 0.5 * math.atan2(2.0 * sxy, sxx - syy)
        sd = math.sqrt((small + 0.001 ** 2) / (n * large) + 0.008 ** 2)
        q.clear()
        self.heading_update(direction, sd)

    # ---------------------------------------------------------------- map
    def stamp(self, px, py):
        ix = int((px + HALF) / CELL)
        iy = int((py + HALF) / CELL)
        if ix < WR or iy < WR or ix >= N - WR or iy >= N - WR:
            return
        dx = GC[ix - WR:ix + WR + 1] - px
        dy = GC[iy - WR:iy + WR + 1] - py
        sub = self.clear[iy - WR:iy + WR + 1, ix - WR:ix + WR + 1]
        np.minimum(sub, np.sqrt((dx * dx)[None, :] + (dy * dy)[:, None]), out=sub)

    def rebuild(self, ix, iy, r):
        """Recompute the clearance in the window of r cells around a cell."""
        x0, x1 = max(0, ix - r), min(N, ix + r + 1)
        y0, y1 = max(0, iy - r), min(N, iy + r + 1)
        old = self.clear
        new = np.full((N, N), FAR) if r > 100 else old.copy()
        new[y0:y1, x0:x1] = FAR
        self.clear = new
        if r > 100:
            for o in self.occ.values():
                self.stamp(o[1], o[2])
            return
        m = r + WR + 1
        for jy in range(max(0, iy - m), min(N, iy + m + 1)):
            for jx in range(max(0, ix - m), min(N, ix + m + 1)):
                o = self.occ.get(jy * N + jx)
                if o is not None:
                    self.stamp(o[1], o[2])

    def sense(self, obs):
        x, y, th = float(self.s[0]), float(self.s[1]), float(self.s[2])
        ps = np.asarray(obs["ps"], dtype=float)
        length = np.interp(ps, TR, TL) * CT
        hit = ps > 82.0
        c, s = math.cos(th), math.sin(th)
        ox = x + c * SX - s * SY
        oy = y + s * SX + c * SY
        ca = np.cos(th + SA)
        sa = np.sin(th + SA)
        free = np.where(hit, length - 0.006, 0.063)
        mx = ox[:, None] + ca[:, None] * SAMP[None, :]
        my = oy[:, None] + sa[:, None] * SAMP[None, :]
        mask = SAMP[None, :] <= free[:, None]
        fx = mx[mask]
        fy = my[mask]
        self.seen[((fy + SHALF) / SC).astype(int), ((fx + SHALF) / SC).astype(int)] = True
        self.seen[((y + BY + SHALF) / SC).astype(int), ((x + BX + SHALF) / SC).astype(int)] = True
        removed = []
        occ = self.occ
        deep = SAMP[None, :] <= free[:, None] - 0.006
        fx = mx[deep].tolist()
        fy = my[deep].tolist()
        done = set()
        for px, py in zip(fx, fy):
            key = int((py + HALF) / CELL) * N + int((px + HALF) / CELL)
            o = occ.get(key)
            if o is None or key in done or self.n - o[3] < 2:
                continue
            if abs(o[1] - px) < 0.004 and abs(o[2] - py) < 0.004:
                done.add(key)
                o[0] -= 1
                if o[0] <= 0:
                    removed.append(key)
        ix0 = int((x + HALF) / CELL)
        iy0 = int((y + HALF) / CELL)
        for jy in range(iy0 - 3, iy0 + 4):
            for jx in range(ix0 - 3, ix0 + 4):
                o = occ.get(jy * N + jx)
                if o is not None and math.hypot(o[1] - x, o[2] - y) < 0.0355:
                    removed.append(jy * N + jx)
        removed = [k for k in set(removed) if k in occ]
        for key in removed:
            del occ[key]
        if len(removed) > 6:
            self.rebuild(ix0, iy0, 20)
        else:
            for key in removed:
                self.rebuild(key % N, key // N, WR + 1)
        for k in range(8):
            px = float(ox[k] + ca[k] * length[k])
            py = float(oy[k] + sa[k] * length[k])
            h = bool(hit[k])
            if k in self.tracks:
                self.track(k, h, px, py, float(length[k]))
            if not h:
                continue
            key = int((py + HALF) / CELL) * N + int((px + HALF) / CELL)
            o = occ.get(key)
            if o is None:
                occ[key] = [2, px, py, self.n]
                self.stamp(px, py)
            else:
                o[0] = min(6, o[0] + 1)
                o[3] = self.n
                if math.hypot(o[1] - px, o[2] - py) > 0.006 or length[k] < 0.03:
                    o[1], o[2] = px, py
                    self.stamp(px, py)

    def forget(self, frac):
        if not self.occ:
            return
        ages = sorted(o[3] for o in self.occ.values())
        limit = ages[min(len(ages) - 1, int(frac * len(ages)))]
        limit = min(limit, self.n - 4)
        self.occ = {k: o for k, o in self.occ.items() if o[3] > limit}
        self.rebuild(N // 2, N // 2, 2 * N)

    # ---------------------------------------------------------------- plan
    def target(self):
        o = self.offs[self.k % len(self.offs)]
        return self.goal[0] + o[0], self.goal[1] + o[1]

    def plan(self):
        t0 = time.process_time()
        x, y = float(self.s[0]), float(self.s[1])
        tx, ty = self.target()
        x0 = max(1, int((min(self.lo[0], tx) - 0.9 + HALF) / CELL))
        x1 = min(N - 1, int((max(self.hi[0], tx) + 0.9 + HALF) / CELL))
        y0 = max(1, int((min(self.lo[1], ty) - 0.9 + HALF) / CELL))
        y1 = min(N - 1, int((max(self.hi[1], ty) + 0.9 + HALF) / CELL))
        cl = self.clear[y0:y1, x0:x1]
        hgt, wid = cl.shape
        gx = GC[x0:x1]
        gy = GC[y0:y1]
        adx = np.abs(gx - tx)[None, :] / CELL
        ady = np.abs(gy - ty)[:, None] / CELL
        h = (np.maximum(adx, ady) + (S2 - 1.0) * np.minimum(adx, ady)).ravel().tolist()
        soft = np.clip((0.07 - cl) / 0.026, 0.0, 1.0)
        base = 1.0 + 2.5 * soft * soft
        near = (gx - x)[None, :] ** 2 + (gy - y)[:, None] ** 2 < 0.035 ** 2
        sx = min(wid - 2, max(1, int((x + HALF) / CELL) - x0))
        sy = min(hgt - 2, max(1, int((y + HALF) / CELL) - y0))
        gix = min(wid - 2, max(1, int((tx + HALF) / CELL) - x0))
        giy = min(hgt - 2, max(1, int((ty + HALF) / CELL) - y0))
        found = None
        for hard in (0.0445, 0.0405, 0.0375):
            cost = np.where(cl < hard, INF, base)
            cost = np.where(near & (cl < hard) & (cl > 0.025), 15.0, cost)
            cost[0, :] = INF
            cost[-1, :] = INF
            cost[:, 0] = INF
            cost[:, -1] = INF
            hend = 1.5 if cost[giy, gix] < 1e6 else 5.0
            found = astar(cost.ravel().tolist(), wid, sy * wid + sx, h, hend, 60000)
            if found is not None:
                self.hard = hard
                break
        self.plan_step = self.n
        self.plan_time = max(0.5 * self.plan_time, time.process_time() - t0)
        if found is None:
            if self.k > 0:
                self.k += 1
            self.path = None
            self.forget(0.4)
            return
        arr = np.array(found)
        self.path = np.stack([gx[arr % wid], gy[arr // wid]], axis=1)
        self.pcell = (arr // wid + y0, arr % wid + x0)
        self.pidx = 0

    def cpu_ok(self):
        return time.process_time() + 1.3 * self.plan_time < 1.6 + 0.0185 * self.n

    def path_bad(self):
        if self.path is None:
            return True
        i = min(self.pidx + 3, len(self.path) - 1)
        c = self.clear[self.pcell[0][i:], self.pcell[1][i:]]
        return bool((c < self.hard - 0.002).any())

    def line_free(self, x, y, px, py):
        d = math.hypot(px - x, py - y)
        m = max(2, int(d / 0.008))
        for i in range(2, m + 1):
            t = i / m
            cx = int((x + (px - x) * t + HALF) / CELL)
            cy = int((y + (py - y) * t + HALF) / CELL)
            if self.clear[cy, cx] < self.hard - 0.002:
                return False
        return True

    def look(self, x, y):
        p = self.path
        i = self.pidx
        j = min(len(p), i + 14)
        d = np.hypot(p[i:j, 0] - x, p[i:j, 1] - y)
        i = i + int(np.argmin(d))
        self.pidx = i
        last = len(p) - 1
        for step in (8, 6, 5, 4, 3, 2):
            q = min(last, i + step)
            if self.line_free(x, y, p[q, 0], p[q, 1]):
                return float(p[q, 0]), float(p[q, 1])
        q = min(last, i + 1)
        return float(p[q, 0]), float(p[q, 1])

    # ---------------------------------------------------------------- control
    def near_points(self, x, y):
        ix = int((x + HALF) / CELL)
        iy = int((y + HALF) / CELL)
        out = []
        occ = self.occ
        for jy in range(iy - 7, iy + 8):
            b = jy * N
            for jx in range(ix - 7, ix + 8):
                o = occ.get(b + jx)
                if o is not None:
                    out.append((o[1] - x, o[2] - y))
        return np.array(out) if out else None

    def verified(self, x, y, th):
        c, s = math.cos(th), math.sin(th)
        for d in (0.042, 0.05, 0.058, 0.066, 0.074):
            if not self.seen[int((y + s * d + SHALF) / SC), int((x + c * d + SHALF) / SC)]:
                return d
        return 1.0

    def clearance_after(self, pts, th, v, turn):
        best = 1.0
        for f in (0.5, 1.0):
            d = v * SMAX * f
            a = th + 0.5 * turn * f
            ex = d * math.cos(a)
            ey = d * math.sin(a)
            m = float(np.sqrt(((pts[:, 0] - ex) ** 2 + (pts[:, 1] - ey) ** 2).min()))
            best = min(best, m)
        return best

    def act(self, obs):
        self.predict(obs)
        self.n += 1
        self.sense(obs)
        x, y, th = float(self.s[0]), float(self.s[1]), float(self.s[2])
        self.lo = [min(self.lo[0], x), min(self.lo[1], y)]
        self.hi = [max(self.hi[0], x), max(self.hi[1], y)]
        tx, ty = self.target()
        if math.hypot(tx - x, ty - y) < 0.025:
            self.k += 1
            self.path = None
        self.hist.append((x, y))
        if len(self.hist) > 90:
            self.hist.popleft()
            hx = [p[0] for p in self.hist]
            hy = [p[1] for p in self.hist]
            if max(hx) - min(hx) < 0.04 and max(hy) - min(hy) < 0.04:
                self.hist.clear()
                self.forget(0.9)
                self.path = None
                if self.k > 0:
                    self.k += 1
        since = self.n - self.plan_step
        if (since >= 2 and self.path_bad()) or since >= 50 or (self.blocked > 4 and since >= 5):
            if self.cpu_ok():
                self.plan()
        pts = self.near_points(x, y)
        cur = 1.0
        if pts is not None:
            cur = float(np.sqrt((pts ** 2).sum(axis=1).min()))
        if self.path is None:
            return 0.3, -0.3
        lx, ly = self.look(x, y)
        desired = math.atan2(ly - y, lx - x)
        if self.blocked > 10 and pts is not None:
            best = -1.0
            for i in range(24):
                a = i * math.pi / 12.0
                m = self.clearance_after(pts, a, 1.0, 0.0) - 0.002 * abs(wrap(a - desired))
                if m > best:
                    best = m
                    self.escape_dir = a
            self.escape = 6
            self.blocked = 0
        if self.escape > 0:
            self.escape -= 1
            desired = self.escape_dir
        err = wrap(desired - th)
        free = self.verified(x, y, th)
        cap = 1.0 if free > 0.5 else max(0.05, (free - 0.041) / SMAX)
        if abs(err) > 0.7:
            turn = max(-0.46, min(0.46, err))
            diff = turn / KT
            return self.wheels(0.0, diff)
        if free < 0.5:
            goal_turn = err + 0.29 * self.wig
            if abs(goal_turn) < 0.06:
                self.wig = -self.wig
                goal_turn = err + 0.29 * self.wig
            lim = 0.13 if cap > 0.3 else 0.25
            turn = max(-lim, min(lim, goal_turn))
        else:
            turn = max(-0.3, min(0.3, err))
        diff = turn / KT
        v = 1.0 - 0.5 * abs(diff)
        if abs(err) > 0.4:
            v *= max(0.0, 1.0 - (abs(err) - 0.4) / 0.3)
        v = max(0.0, min(v, cap))
        if pts is not None:
            ahead = pts[:, 0] * math.cos(th) + pts[:, 1] * math.sin(th)
            front = pts[ahead > 0.015]
            if len(front) and float(np.sqrt((front ** 2).sum(axis=1).min())) < 0.052:
                v = min(v, 0.65)
            margin = max(0.0385, min(0.0405, self.hard - 0.001))
            ok = 0.0
            for f in (1.0, 0.75, 0.5, 0.3, 0.15):
                m = self.clearance_after(pts, th, v * f, turn)
                if m >= margin or m > cur + 0.0002:
                    ok = f
                    break
            if ok == 0.0 and abs(err) < 0.5:
                self.blocked += 1
            elif ok > 0.0:
                self.blocked = max(0, self.blocked - 1)
            v *= ok
            if ok == 0.0:
                turn = max(-0.4, min(0.4, err if abs(err) > 0.05 else turn))
                diff = turn / KT
        return self.wheels(v, diff)

    def wheels(self, v, diff):
        left = v - 0.5 * diff
        right = v + 0.5 * diff
        return max(-1.0, min(1.0, left)), max(-1.0, min(1.0, right))


ROBOT = None


def reset(obs):
    global ROBOT
    ROBOT = Robot(obs)


def policy(obs):
    if ROBOT is None:
        reset(obs)
    left, right = ROBOT.act(obs)
    return float(left), float(right)
