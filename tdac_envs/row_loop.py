"""The compiled loop over rows of `tdac_envs.rows`, which several threads run at once.

Numbers are words of 64 bits. The `door` says who may work:

| word | content |
|---|---|
| `OPEN` | number of the call that is being made; 0 when none is |
| `INSIDE` | helpers that are at work |
| `FAILED` | not 0 where a helper's call failed |
| `TAKEN + APART * k` | the next place in the order that thread k has not taken |

Words that one thread writes and others read lie `APART` words from each other, so that
they share no line of the cache. The `plan` says what is done; see the constants. A
thread first takes the places of its own part of the order, so that rows stay in the
cache of one core from call to call, and then what the others have left.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable

from tdac_envs.machine_code import kept, link, optimised

# Words of the door.
APART = 16
OPEN, INSIDE, FAILED, TAKEN = (APART * k for k in range(4))
# Words of the plan: places taken at a time; rows in their order; number of each row's
# kernel; the kernels; words that are the row's own, how many, and those of each row;
# pieces copied before and after a row's call, and how many; threads; end of each part.
SHARE, ORDER, KINDS, ENTRIES, COLUMNS, WIDTH, VALUES = range(7)
GIVEN, N_GIVEN, RETURNED, N_RETURNED = range(7, 11)
THREADS, ENDS, N_PLAN = range(11, 14)
# Words of a piece: address and bytes from row to row, to and from; bytes of a row.
N_PIECE = 5

Loop = Callable[[int, int, int, int, int], int]

_CODE = f"""
declare i32 @sched_yield()
declare ptr @memcpy(ptr, ptr, i64)

define internal i64 @word(ptr %words, i64 %which) {{
  %at = getelementptr i64, ptr %words, i64 %which
  %value = load i64, ptr %at
  ret i64 %value
}}

define internal ptr @address(ptr %words, i64 %which) {{
  %value = call i64 @word(ptr %words, i64 %which)
  %address = inttoptr i64 %value to ptr
  ret ptr %address
}}

define internal ptr @at_row(ptr %piece, i64 %which, i64 %row) {{
  %base = call ptr @address(ptr %piece, i64 %which)
  %next = add i64 %which, 1
  %step = call i64 @word(ptr %piece, i64 %next)
  %offset = mul i64 %step, %row
  %at = getelementptr i8, ptr %base, i64 %offset
  ret ptr %at
}}

define internal void @copy(ptr %pieces, i64 %count, i64 %row) {{
start:
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %each]
  %more = icmp slt i64 %number, %count
  br i1 %more, label %each, label %end
each:
  %piece = getelementptr [{N_PIECE} x i64], ptr %pieces, i64 %number
  %to = call ptr @at_row(ptr %piece, i64 0, i64 %row)
  %from = call ptr @at_row(ptr %piece, i64 2, i64 %row)
  %length = call i64 @word(ptr %piece, i64 4)
  call ptr @memcpy(ptr %to, ptr %from, i64 %length)
  %after = add i64 %number, 1
  br label %next
end:
  ret void
}}

define internal void @fill(ptr %plan, ptr %slots, i64 %row) {{
start:
  %columns = call ptr @address(ptr %plan, i64 {COLUMNS})
  %width = call i64 @word(ptr %plan, i64 {WIDTH})
  %values = call ptr @address(ptr %plan, i64 {VALUES})
  %first = mul i64 %row, %width
  %own = getelementptr i64, ptr %values, i64 %first
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %each]
  %more = icmp slt i64 %number, %width
  br i1 %more, label %each, label %end
each:
  %column = call i64 @word(ptr %columns, i64 %number)
  %value = call i64 @word(ptr %own, i64 %number)
  %slot = getelementptr i64, ptr %slots, i64 %column
  store i64 %value, ptr %slot
  %after = add i64 %number, 1
  br label %next
end:
  ret void
}}

define internal i32 @make(ptr %plan, ptr %slots, i64 %place) {{
  %order = call ptr @address(ptr %plan, i64 {ORDER})
  %row = call i64 @word(ptr %order, i64 %place)
  call void @fill(ptr %plan, ptr %slots, i64 %row)
  %given = call ptr @address(ptr %plan, i64 {GIVEN})
  %n_given = call i64 @word(ptr %plan, i64 {N_GIVEN})
  call void @copy(ptr %given, i64 %n_given, i64 %row)
  %kinds = call ptr @address(ptr %plan, i64 {KINDS})
  %kind_at = getelementptr i8, ptr %kinds, i64 %row
  %kind = load i8, ptr %kind_at
  %which = zext i8 %kind to i64
  %entries = call ptr @address(ptr %plan, i64 {ENTRIES})
  %entry = call ptr @address(ptr %entries, i64 %which)
  %status = call i32 %entry(ptr %slots)
  %returned = call ptr @address(ptr %plan, i64 {RETURNED})
  %n_returned = call i64 @word(ptr %plan, i64 {N_RETURNED})
  call void @copy(ptr %returned, i64 %n_returned, i64 %row)
  ret i32 %status
}}

define internal i32 @share(ptr %plan, ptr %slots, i64 %begin, i64 %end) {{
start:
  br label %next
next:
  %place = phi i64 [%begin, %start], [%after, %each]
  %failed = phi i32 [0, %start], [%either, %each]
  %more = icmp slt i64 %place, %end
  br i1 %more, label %each, label %end_
each:
  %status = call i32 @make(ptr %plan, ptr %slots, i64 %place)
  %either = or i32 %failed, %status
  %after = add i64 %place, 1
  br label %next
end_:
  ret i32 %failed
}}

define internal i32 @part(ptr %door, ptr %plan, ptr %slots, i64 %whose) {{
start:
  %far = mul i64 %whose, {APART}
  %which = add i64 %far, {TAKEN}
  %taken = getelementptr i64, ptr %door, i64 %which
  %ends = call ptr @address(ptr %plan, i64 {ENDS})
  %last = call i64 @word(ptr %ends, i64 %whose)
  %size = call i64 @word(ptr %plan, i64 {SHARE})
  br label %next
next:
  %failed = phi i32 [0, %start], [%either, %each]
  %begin = atomicrmw add ptr %taken, i64 %size monotonic
  %more = icmp slt i64 %begin, %last
  br i1 %more, label %each, label %end
each:
  %full = add i64 %begin, %size
  %short = icmp slt i64 %last, %full
  %until = select i1 %short, i64 %last, i64 %full
  %status = call i32 @share(ptr %plan, ptr %slots, i64 %begin, i64 %until)
  %either = or i32 %failed, %status
  br label %next
end:
  ret i32 %failed
}}

define internal i32 @work(ptr %door, ptr %plan, ptr %slots, i64 %me) {{
start:
  %threads = call i64 @word(ptr %plan, i64 {THREADS})
  br label %next
next:
  %number = phi i64 [0, %start], [%after, %each]
  %failed = phi i32 [0, %start], [%either, %each]
  %more = icmp slt i64 %number, %threads
  br i1 %more, label %each, label %end
each:
  %sum = add i64 %me, %number
  %whose = urem i64 %sum, %threads
  %status = call i32 @part(ptr %door, ptr %plan, ptr %slots, i64 %whose)
  %either = or i32 %failed, %status
  %after = add i64 %number, 1
  br label %next
end:
  ret i32 %failed
}}

define internal i32 @help(
    ptr %door, ptr %plan, ptr %slots, i64 %me, i64 %call
) {{
  %inside = getelementptr i64, ptr %door, i64 {INSIDE}
  %came = atomicrmw add ptr %inside, i64 1 seq_cst
  %now = load atomic i64, ptr %door seq_cst, align 8
  %open = icmp eq i64 %now, %call
  br i1 %open, label %enter, label %leave
enter:
  %status = call i32 @work(ptr %door, ptr %plan, ptr %slots, i64 %me)
  %told = zext i32 %status to i64
  %failed = getelementptr i64, ptr %door, i64 {FAILED}
  %before = atomicrmw or ptr %failed, i64 %told seq_cst
  br label %leave
leave:
  %went = atomicrmw sub ptr %inside, i64 1 seq_cst
  ret i32 0
}}

define i32 @tdac_rows(
    ptr %door, ptr %plan, ptr %slots, i64 %me, i64 %call
) {{
  %leads = icmp eq i64 %me, 0
  br i1 %leads, label %lead, label %helps
helps:
  %none = call i32 @help(
    ptr %door, ptr %plan, ptr %slots, i64 %me, i64 %call
  )
  ret i32 %none
lead:
  %own = call i32 @work(ptr %door, ptr %plan, ptr %slots, i64 0)
  store atomic i64 0, ptr %door seq_cst, align 8
  %inside = getelementptr i64, ptr %door, i64 {INSIDE}
  br label %wait
wait:
  %busy = load atomic i64, ptr %inside seq_cst, align 8
  %alone = icmp eq i64 %busy, 0
  br i1 %alone, label %end, label %yield
yield:
  %ignored = call i32 @sched_yield()
  br label %wait
end:
  %failed = getelementptr i64, ptr %door, i64 {FAILED}
  %theirs = load atomic i64, ptr %failed seq_cst, align 8
  %told = trunc i64 %theirs to i32
  %either = or i32 %own, %told
  ret i32 %either
}}
"""


@functools.cache
def row_loop() -> Loop:
    """The loop: of the addresses of door, plan and slots, of who works, of the call.

    Thread 0 makes the call and returns when all rows have been called, not 0 where one
    of them failed. The others help where this call is still being made.
    """
    objects = kept("row_loop", [_CODE], lambda: [optimised(_CODE)])
    engine, address = link(objects, "tdac_rows")
    word = ctypes.c_int64
    pointer = ctypes.c_void_p
    kinds = (pointer, pointer, pointer, word, word)
    loop = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(address)
    # The engine holds the code.
    loop.engine = engine  # type: ignore[attr-defined]
    return loop
