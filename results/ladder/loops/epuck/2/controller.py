import math
import heapq
import time
import numpy as np

RB = 0.037
AXLE = 0.052
WR = 0.02
WMAX = 6.28
DT = 0.1
VM = WMAX * WR * DT            # 0.01256 m in a step
TM = 2.0 * VM / AXLE           # 0.483 rad in a step

SX = np.array([0.03, 0.022, 0.0, -0.03, -0.03, 0.0, 0.022, 0.03])
SY = np.array([-0.01, -0.025, -0.031, -0.015, 0.015, 0.031, 0.025, 0.01])
SA = np.array([-0.3008, -0.8008, -1.5708, -2.644, 2.6392, 1.5708, 0.7992, 0.2992])
RD = np.array([67.19, 104.09, 120.0, 158.03, 234.93, 383.84, 601.46, 1465.73, 2133.33, 4095.0])
LN = np.array([0.070, 0.060, 0.050, 0.040, 0.030, 0.020, 0.015, 0.010, 0.005, 0.0])
CEL = math.cos(0.16)

RES = 0.01
HALF = 300                     # cells of 1 cm on each side of the start
N = 2 * HALF
CAP = 0.10
KR = 10
EXT = 0.005                    # ends of surfaces are extended by this

HARD = 0.037
S = {}


def wrap(a):
    return (a + math.pi) % (2.0 * math.pi) - math.pi


def wrap4(a):
    q = 0.5 * math.pi
    return (a + 0.25 * math.pi) % q - 0.25 * math.pi


def cell(v):
    return int(math.floor(v / RES)) + HALF


def centre(i):
    return (i - HALF + 0.5) * RES


def reset(obs):
    S.clear()
    S["n"] = 0
    S["s"] = np.zeros(5)       # x, y, heading, wall direction, turn bias per metre
    P = np.zeros((5, 5))
    P[4, 4] = 0.157 ** 2
    S["P"] = P
    S["phi_ok"] = False
    S["rej"] = 0
    S["raw"] = [0.0, 0.0, 0.0]
    S["buf"] = [[], []]
    S["enc"] = np.array(obs["encoders"], dtype=np.float64)
    S["L"] = np.zeros((N, N), dtype=np.float32)
    S["occ"] = np.zeros((N, N), dtype=bool)
    S["hx"] = np.zeros((N, N), dtype=np.float32)
    S["hy"] = np.zeros((N, N), dtype=np.float32)
    S["clr"] = np.full((N, N), CAP, dtype=np.float32)
    S["pen"] = np.zeros((N, N), dtype=np.float32)
    S["goal"] = (float(obs["goal"][0]), float(obs["goal"][1]))
    S["pts"] = [(0.0, 0.0), S["goal"]]
    S["path"] = []
    S["plan_n"] = -100
    S["hist"] = []
    S["recover"] = 0
    S["rec_dir"] = 0.0
    S["search"] = 0
    S["search_n"] = 0
    S["stuck"] = 0
    S["through"] = 0
    S["trail"] = [[] for _ in range(8)]
    offs = [(0.0, 0.0)]
    for r, m in ((0.09, 6), (0.17, 9), (0.26, 12), (0.36, 16)):
        for k in range(m):
            a = 2.0 * math.pi * k / m
            offs.append((r * math.cos(a), r * math.sin(a)))
    S["offs"] = offs


# ---------------------------------------------------------------- pose

def predict(obs):
    enc = np.array(obs["encoders"], dtype=np.float64)
    d = (enc - S["enc"]) * WR
    S["enc"] = enc
    dl, dr = float(d[0]), float(d[1])
    ds = 0.5 * (dl + dr)
    te = (dr - dl) / AXLE
    s = S["s"]
    dth = te + s[4] * ds
    thm = s[2] + 0.5 * dth
    F = np.eye(5)
    F[0, 2] = -ds * math.sin(thm)
    F[1, 2] = ds * math.cos(thm)
    F[2, 4] = ds
    F[0, 4] = -0.5 * ds * ds * math.sin(thm)
    F[1, 4] = 0.5 * ds * ds * math.cos(thm)
    s[0] += ds * math.cos(thm)
    s[1] += ds * math.sin(thm)
    s[2] = wrap(s[2] + dth)
    P = F.dot(S["P"]).dot(F.T)
    q = (0.02 ** 2) * (dl * dl + dr * dr) / (AXLE * AXLE) + (0.006 * te) ** 2
    P[2, 2] += q
    P[0, 0] += (0.016 * ds) ** 2
    P[1, 1] += (0.016 * ds) ** 2
    S["P"] = P
    r = S["raw"]
    rm = r[2] + 0.5 * dth
    r[0] += ds * math.cos(rm)
    r[1] += ds * math.sin(rm)
    r[2] += dth


def angle_update(z, R, length):
    """z: direction of a wall in the frame of the robot, modulo a quarter turn"""
    s = S["s"]
    P = S["P"]
    if not S["phi_ok"]:
        if length < 0.078:
            return
        s[3] = wrap4(s[2] + z)
        P[3, :] = P[2, :]
        P[:, 3] = P[:, 2]
        P[3, 3] = P[2, 2] + R
        S["phi_ok"] = True
        return
    nu = wrap4(z - (s[3] - s[2]))
    H = np.array([0.0, 0.0, -1.0, 1.0, 0.0])
    PH = P.dot(H)
    Sv = float(H.dot(PH)) + R
    if nu * nu > 9.0 * Sv or abs(nu) > 0.4:
        S["rej"] += 1
        if S["rej"] >= 4:
            P[2, 2] += 0.01
            S["rej"] = 0
        return
    S["rej"] = 0
    K = PH / Sv
    s += K * nu
    s[2] = wrap(s[2])
    s[4] = min(max(s[4], -0.42), 0.42)
    P = P - np.outer(K, PH)
    S["P"] = 0.5 * (P + P.T)


def wall_lines(length):
    raw = S["raw"]
    c, sn = math.cos(raw[2]), math.sin(raw[2])
    n = S["n"]
    for side, ids in ((0, (1, 2)), (1, (6, 5))):
        buf = S["buf"][side]
        for k in ids:
            ln = length[k]
            if ln < 0.056:
                d = ln * CEL
                bx = SX[k] + d * math.cos(SA[k])
                by = SY[k] + d * math.sin(SA[k])
                buf.append((n, raw[0] + c * bx - sn * by, raw[1] + sn * bx + c * by))
        while buf and buf[0][0] < n - 22:
            buf.pop(0)
        if len(buf) < 8 or buf[-1][0] - buf[0][0] < 4:
            continue
        a = np.array(buf)
        x = a[:, 1] - a[:, 1].mean()
        y = a[:, 2] - a[:, 2].mean()
        sxx = float((x * x).mean())
        syy = float((y * y).mean())
        sxy = float((x * y).mean())
        ang = 0.5 * math.atan2(2.0 * sxy, sxx - syy)
        t = x * math.cos(ang) + y * math.sin(ang)
        e = -x * math.sin(ang) + y * math.cos(ang)
        rms = math.sqrt(float((e * e).mean()))
        ext = float(t.max() - t.min())
        if rms > 0.0022 or float(np.abs(e).max()) > 0.007:
            if len(buf) >= 10:
                S["buf"][side] = buf[len(buf) // 2:]
            continue
        need = 0.08 if not S["phi_ok"] else 0.065
        if ext < need:
            continue
        R = (0.0018 * 3.5 / math.sqrt(len(buf)) / ext) ** 2 + 0.013 ** 2
        angle_update(ang - raw[2], R, ext)
        S["buf"][side] = []


# ---------------------------------------------------------------- map

def stamp(i, j):
    """i: row (y), j: column (x)"""
    clr = S["clr"]
    a0, a1 = max(i - KR, 0), min(i + KR + 1, N)
    b0, b1 = max(j - KR, 0), min(j + KR + 1, N)
    yy = (np.arange(a0, a1) - HALF + 0.5) * RES - S["hy"][i, j]
    xx = (np.arange(b0, b1) - HALF + 0.5) * RES - S["hx"][i, j]
    d = np.sqrt(yy[:, None] ** 2 + xx[None, :] ** 2).astype(np.float32)
    np.minimum(clr[a0:a1, b0:b1], d, out=clr[a0:a1, b0:b1])


def rebuild(cells):
    if not cells:
        return
    i0 = max(min(c[0] for c in cells) - KR, 0)
    i1 = min(max(c[0] for c in cells) + KR + 1, N)
    j0 = max(min(c[1] for c in cells) - KR, 0)
    j1 = min(max(c[1] for c in cells) + KR + 1, N)
    S["clr"][i0:i1, j0:j1] = CAP
    a0, a1 = max(i0 - KR, 0), min(i1 + KR, N)
    b0, b1 = max(j0 - KR, 0), min(j1 + KR, N)
    ii, jj = np.nonzero(S["occ"][a0:a1, b0:b1])
    for i, j in zip(ii.tolist(), jj.tolist()):
        stamp(i + a0, j + b0)


def clr_at(x, y):
    g = x / RES + HALF - 0.5
    h = y / RES + HALF - 0.5
    j = int(math.floor(g))
    i = int(math.floor(h))
    if i < 0 or j < 0 or i >= N - 1 or j >= N - 1:
        return 0.0
    fx = g - j
    fy = h - i
    c = S["clr"]
    return float((c[i, j] * (1 - fx) + c[i, j + 1] * fx) * (1 - fy)
                 + (c[i + 1, j] * (1 - fx) + c[i + 1, j + 1] * fx) * fy)


def add_end(x, y):
    """an end of a surface, not seen itself"""
    i, j = cell(y), cell(x)
    if not (0 <= i < N and 0 <= j < N) or S["occ"][i, j]:
        return
    S["occ"][i, j] = True
    S["L"][i, j] = 0.5
    S["hx"][i, j] = x
    S["hy"][i, j] = y
    stamp(i, j)


def update_map(ps, length):
    x, y, th = float(S["s"][0]), float(S["s"][1]), float(S["s"][2])
    c, sn = math.cos(th), math.sin(th)
    L = S["L"]
    occ = S["occ"]
    HX = S["hx"]
    HY = S["hy"]
    removed = []
    hits = []
    weak = set()
    ends = []
    hitcells = set()
    rays = []
    for k in range(8):
        px = x + c * SX[k] - sn * SY[k]
        py = y + sn * SX[k] + c * SY[k]
        ux = math.cos(th + SA[k])
        uy = math.sin(th + SA[k])
        hit = ps[k] > 82.0
        d = float(length[k]) * CEL
        tr = S["trail"][k]
        if hit:
            hx = px + d * ux
            hy = py + d * uy
            hits.append((cell(hy), cell(hx), hx, hy, 1.0 if ps[k] > 112.0 else 0.45))
            hitcells.add((cell(hy), cell(hx)))
            if ps[k] > 112.0:
                if tr:
                    g = math.hypot(hx - tr[-1][0], hy - tr[-1][1])
                    if g > 0.025:
                        if len(tr) >= 2:
                            ends.append((tr[-2], tr[-1]))
                        tr = []
                    elif g > 0.003 and len(tr) == 1:
                        ends.append(((hx, hy), tr[0]))
                if not tr or math.hypot(hx - tr[-1][0], hy - tr[-1][1]) > 0.003:
                    tr.append((hx, hy))
                S["trail"][k] = tr[-3:]
        else:
            if len(tr) >= 2:
                ends.append((tr[-2], tr[-1]))
            S["trail"][k] = []
        rays.append((px, py, ux, uy, d - 0.014 if hit else 0.061))
    for px, py, ux, uy, end in rays:
        t = 0.0
        seen = set()
        while t < end:
            ij = (cell(py + t * uy), cell(px + t * ux))
            t += 0.006
            if ij in seen or ij in hitcells:
                continue
            seen.add(ij)
            i, j = ij
            if not (0 <= i < N and 0 <= j < N):
                continue
            if occ[i, j]:
                # only a ray through the point itself speaks against it
                ex = float(HX[i, j]) - px
                ey = float(HY[i, j]) - py
                al = ex * ux + ey * uy
                if abs(ex * uy - ey * ux) < 0.0035 and 0.0 < al < end:
                    L[i, j] -= 0.2
                    if L[i, j] < 0.1:
                        occ[i, j] = False
                        removed.append((i, j))
            else:
                weak.add(ij)
    for i, j in weak:
        if not occ[i, j]:
            L[i, j] = max(L[i, j] - 0.2, -0.4)
    # the body stands on free floor
    bi, bj = cell(y), cell(x)
    for i in range(bi - 4, bi + 5):
        for j in range(bj - 4, bj + 5):
            if 0 <= i < N and 0 <= j < N and occ[i, j]:
                if math.hypot(HX[i, j] - x, HY[i, j] - y) < 0.032:
                    occ[i, j] = False
                    L[i, j] = -0.3
                    removed.append((i, j))
    rebuild(removed)
    for i, j, hx, hy, w in hits:
        if not (0 <= i < N and 0 <= j < N):
            continue
        if w > 0.9:
            L[i, j] = max(L[i, j], 0.0)
        L[i, j] = min(L[i, j] + w, 3.0)
        if not occ[i, j]:
            if L[i, j] > 0.5:
                occ[i, j] = True
                HX[i, j] = hx
                HY[i, j] = hy
                stamp(i, j)
                if S["n"] % 2 == 0 or len(S["pts"]) < 200:
                    S["pts"].append((hx, hy))
        elif w > 0.9:
            ox, oy = float(HX[i, j]), float(HY[i, j])
            nx, ny = 0.6 * ox + 0.4 * hx, 0.6 * oy + 0.4 * hy
            if math.hypot(nx - ox, ny - oy) > 0.001:
                HX[i, j] = nx
                HY[i, j] = ny
                stamp(i, j)
    for a, b in ends:
        g = math.hypot(b[0] - a[0], b[1] - a[1])
        if 0.003 <= g <= 0.025:
            qx = b[0] + EXT * (b[0] - a[0]) / g
            qy = b[1] + EXT * (b[1] - a[1]) / g
            if math.hypot(qx - x, qy - y) > 0.039:
                add_end(qx, qy)


# ---------------------------------------------------------------- plan

def subgoal():
    g = S["goal"]
    o = S["offs"][min(S["search"], len(S["offs"]) - 1)]
    return g[0] + o[0], g[1] + o[1]


def plan():
    x, y = float(S["s"][0]), float(S["s"][1])
    gx, gy = subgoal()
    sub = S["clr"][::2, ::2]
    pen = S["pen"][::2, ::2]
    M = sub.shape[0]
    cost = np.ones(sub.shape, dtype=np.float32)
    cost[sub < 0.094] = 0.92
    cost[sub < 0.076] = 1.05
    cost[sub < 0.068] = 1.35
    cost[sub < 0.060] = 2.0
    tight = sub < 0.053
    cost[tight] = 3.0 + 5.0 * (0.053 - sub[tight]) / 0.016
    cost += pen
    cost[sub < HARD] = 120.0
    # the sides of the world are at most 2 m
    pts = S["pts"]
    ax = (np.arange(M) * 2 - HALF + 0.5) * RES
    if S["phi_ok"]:
        f = float(S["s"][3])
        cf, sf = math.cos(f), math.sin(f)
        arr = np.array(pts)
        u = arr[:, 0] * cf + arr[:, 1] * sf
        v = -arr[:, 0] * sf + arr[:, 1] * cf
        U = ax[None, :] * cf + ax[:, None] * sf
        V = -ax[None, :] * sf + ax[:, None] * cf
        m = 0.06
        out = (U > u.min() + 2.0 + m) | (U < u.max() - 2.0 - m) | \
              (V > v.min() + 2.0 + m) | (V < v.max() - 2.0 - m)
        cost[out] = 400.0
    else:
        R2 = ax[None, :] ** 2 + ax[:, None] ** 2
        cost[R2 > 2.85 ** 2] = 400.0
    cost[0, :] = 0.0
    cost[-1, :] = 0.0
    cost[:, 0] = 0.0
    cost[:, -1] = 0.0
    W = cost.ravel().tolist()
    si = min(max(int(round((cell(y)) / 2.0)), 1), M - 2)
    sj = min(max(int(round((cell(x)) / 2.0)), 1), M - 2)
    ti = min(max(int(round((cell(gy)) / 2.0)), 1), M - 2)
    tj = min(max(int(round((cell(gx)) / 2.0)), 1), M - 2)
    src = si * M + sj
    dst = ti * M + tj
    q = 0.5
    nb = [(1, q), (-1, q), (M, q), (-M, q),
          (M + 1, q * 1.41421), (M - 1, q * 1.41421), (-M + 1, q * 1.41421), (-M - 1, q * 1.41421)]
    dist = {src: 0.0}
    par = {src: -1}
    closed = set()
    heap = [(0.0, src)]
    pop = heapq.heappop
    push = heapq.heappush
    found = False
    while heap:
        f, u = pop(heap)
        if u == dst:
            found = True
            break
        if u in closed:
            continue
        closed.add(u)
        du = dist[u]
        wu = W[u]
        for off, ln in nb:
            v = u + off
            wv = W[v]
            if wv <= 0.0 or v in closed:
                continue
            nd = du + ln * (wu + wv)
            if nd < dist.get(v, 1e18):
                dist[v] = nd
                par[v] = u
                a = abs(v // M - ti)
                b = abs(v % M - tj)
                h = 0.92 * (a + b - 0.58579 * (a if a < b else b))
                push(heap, (nd + h, v))
    path = []
    blocked = []
    if found:
        u = dst
        while u != -1:
            i, j = u // M, u % M
            p = (centre(2 * j), centre(2 * i))
            path.append(p)
            if W[u] >= 100.0 and math.hypot(p[0] - x, p[1] - y) > 0.06:
                blocked.append(p)
            u = par[u]
        path.reverse()
        path = path[1:] if len(path) > 1 else path
        path.append((gx, gy))
    S["path"] = path
    S["plan_n"] = S["n"]
    return blocked


def forget(pts):
    """erase what the map says around these points"""
    removed = []
    for p in pts:
        bi, bj = cell(p[1]), cell(p[0])
        for i in range(max(bi - 5, 0), min(bi + 6, N)):
            for j in range(max(bj - 5, 0), min(bj + 6, N)):
                if S["occ"][i, j]:
                    S["occ"][i, j] = False
                    S["L"][i, j] = 0.0
                    removed.append((i, j))
    rebuild(removed)


def line_clear(x0, y0, x1, y1, lim):
    d = math.hypot(x1 - x0, y1 - y0)
    m = max(int(d / 0.01), 1)
    for k in range(1, m + 1):
        t = k / m
        if clr_at(x0 + t * (x1 - x0), y0 + t * (y1 - y0)) < lim:
            return False
    return True


def path_blocked():
    x, y = float(S["s"][0]), float(S["s"][1])
    k = 0
    for p in S["path"]:
        if math.hypot(p[0] - x, p[1] - y) > 0.02 and clr_at(p[0], p[1]) < 0.044:
            return True
        k += 1
        if k > 25:
            break
    return False


def can_go(x, y, a, lim):
    c0 = clr_at(x, y)
    for d in (0.5 * VM, VM, 1.5 * VM):
        c1 = clr_at(x + d * math.cos(a), y + d * math.sin(a))
        if c1 < lim and c1 < c0 + 0.25 * d:
            return False
    return True


OFF1 = [0.0, 0.15, -0.15, 0.3, -0.3, 0.45, -0.45, 0.65, -0.65]
OFF2 = [0.0, 0.2, -0.2, 0.4, -0.4, 0.65, -0.65, 0.9, -0.9, 1.2, -1.2, 1.5, -1.5]


def drive(a, length):
    """wheel commands that move the robot towards the direction a"""
    x, y, th = float(S["s"][0]), float(S["s"][1]), float(S["s"][2])
    best = None
    keep = 0.0415
    for lim, offs in ((0.055, OFF1), (0.048, OFF1), (0.0425, OFF2), (0.0405, OFF2)):
        for o in offs:
            if can_go(x, y, a + o, lim):
                best = a + o
                keep = lim
                break
        if best is not None:
            break
    if best is None:
        err = wrap(a - th)
        w = min(max(err / TM, -0.6), 0.6)
        return -w, w
    err = wrap(best - th)
    back = False
    if abs(err) > 2.2:
        # close to a wall: reverse a little instead of a long turn
        if S["recover"] > 0:
            back = True
            err = wrap(err + math.pi)
    if abs(err) > 0.6:
        w = 1.0 if err > 0 else -1.0
        w *= min(1.0, abs(err) / TM)
        return -w, w
    w = min(max(0.85 * err / TM, -0.8), 0.8)
    v = (1.0 - abs(w)) * max(math.cos(err), 0.0)
    sg = -1.0 if back else 1.0
    hm = th + 0.5 * w * TM
    if back:
        hm = th + 0.5 * w * TM
    # the step itself
    c0 = clr_at(x, y)
    ca = clr_at(x + sg * 1.5 * VM * math.cos(hm), y + sg * 1.5 * VM * math.sin(hm))
    lo = min(c0, ca)
    if lo < 0.047:
        v = min(v, 0.45)
    elif lo < 0.055:
        v = min(v, 0.7)
    lim = keep - 0.0015
    ok = False
    for f in (1.0, 0.6, 0.3):
        d = sg * v * f * VM
        c1 = clr_at(x + d * math.cos(hm), y + d * math.sin(hm))
        c2 = clr_at(x + 0.5 * d * math.cos(hm), y + 0.5 * d * math.sin(hm))
        if min(c1, c2) >= lim or (c1 > c0 + 0.1 * abs(d) and c2 >= c0 - 0.0002):
            v *= f
            ok = True
            break
    if not ok:
        v = 0.0
    if not back:
        if min(length[0], length[7]) < 0.012:
            v = 0.0
        # close at the front side, and not turning away from it
        if length[1] < 0.014 and w < 0.25:
            v = min(v, 0.3) if length[1] > 0.009 else 0.0
        if length[6] < 0.014 and w > -0.25:
            v = min(v, 0.3) if length[6] > 0.009 else 0.0
    else:
        if min(length[3], length[4]) < 0.012:
            v = 0.0
    if v == 0.0 and abs(w) < 0.15:
        if length[1] < length[6]:
            w = 0.2
        elif length[6] < length[1]:
            w = -0.2
        else:
            w = 0.15 if err >= 0 else -0.15
    return sg * v - w, sg * v + w


def clip1(l, r):
    if not (math.isfinite(l) and math.isfinite(r)):
        return 0.0, 0.0
    return float(min(max(l, -1.0), 1.0)), float(min(max(r, -1.0), 1.0))


def policy(obs):
    if "n" not in S:
        reset(obs)
    S["n"] += 1
    n = S["n"]
    ps = np.asarray(obs["ps"], dtype=np.float64)
    length = np.interp(ps, RD, LN)
    length = np.where(ps > 82.0, length, 0.07)
    predict(obs)
    wall_lines(length)
    update_map(ps, length)
    x, y, th = float(S["s"][0]), float(S["s"][1]), float(S["s"][2])
    if n % 4 == 0:
        S["pts"].append((x, y))
    S["hist"].append((x, y))

    # arrived by the estimate, but not in truth: search around
    gx, gy = subgoal()
    dg = math.hypot(gx - x, gy - y)
    if dg < 0.018 or (S["search"] > 0 and n - S["search_n"] > 70):
        if S["search"] < len(S["offs"]) - 1:
            S["search"] += 1
        else:
            S["search"] = 1
        S["search_n"] = n
        S["plan_n"] = -100

    # no progress
    if len(S["hist"]) > 26 and S["recover"] == 0:
        hx, hy = S["hist"][-26]
        if math.hypot(hx - x, hy - y) < 0.018:
            S["stuck"] += 1
            S["hist"] = []
            S["recover"] = 9
            best = -1.0
            for k in range(16):
                a = th + 2.0 * math.pi * k / 16
                q = min(clr_at(x + 0.02 * math.cos(a), y + 0.02 * math.sin(a)),
                        clr_at(x + 0.05 * math.cos(a), y + 0.05 * math.sin(a)) - 0.002)
                q += 0.001 * ((k * 7 + S["stuck"] * 5) % 16) / 16.0
                if q > best:
                    best = q
                    S["rec_dir"] = a
            if S["path"]:
                p = S["path"][min(2, len(S["path"]) - 1)]
                i, j = cell(p[1]), cell(p[0])
                S["pen"][max(i - 4, 0):i + 5, max(j - 4, 0):j + 5] += 2.0
            if dg < 0.16 and S["search"] < len(S["offs"]) - 1:
                S["search"] += 1
                S["search_n"] = n
            S["plan_n"] = -100

    if S["recover"] > 0:
        l, r = drive(S["rec_dir"], length)
        S["recover"] -= 1
        if S["recover"] == 0:
            S["plan_n"] = -100
        return clip1(l, r)

    # plan
    left = 2.0 + 0.02 * n - time.process_time()
    age = n - S["plan_n"]
    period = 6 if left > 1.0 else (12 if left > 0.6 else 30)
    need = age >= period or not S["path"]
    if not need and age >= 2 and left > 0.6 and path_blocked():
        need = True
    if need and left > 0.25:
        blocked = plan()
        if blocked:
            # closed in by what may be errors of the map
            S["through"] += 1
            if S["through"] >= 3:
                S["through"] = 0
                forget(blocked)
                S["plan_n"] = n - 5
        else:
            S["through"] = 0

    path = S["path"]
    if not path:
        a = math.atan2(gy - y, gx - x)
        return clip1(*drive(a, length))
    # drop what lies behind
    bi = 0
    bd = 1e9
    for k in range(min(len(path), 14)):
        d = math.hypot(path[k][0] - x, path[k][1] - y)
        if d < bd - 1e-9:
            bd = d
            bi = k
    if bi > 0:
        path = path[bi:]
        S["path"] = path
    if len(path) > 1 and bd < 0.012:
        path = path[1:]
        S["path"] = path
    target = None
    lim0 = min([clr_at(p[0], p[1]) for p in path[:4]])
    lim = max(min(0.066, lim0 - 0.002), 0.043)
    for k in range(min(8, len(path) - 1), 0, -1):
        if line_clear(x, y, path[k][0], path[k][1], lim):
            target = path[k]
            break
    if target is None:
        target = path[min(1, len(path) - 1)]
        if math.hypot(target[0] - x, target[1] - y) < 0.012:
            target = path[min(2, len(path) - 1)]
    a = math.atan2(target[1] - y, target[0] - x)
    return clip1(*drive(a, length))
