"""The colours of what has been judged, which reports and the studio share.

Green is for what is verified alone; what only passed or ended has another colour.
"""

STATUS_STYLE = """
:root {
  --good: #0b7a53; --good-pale: #e2f3ec; --bad: #b4380a; --bad-pale: #fbe9e1;
  --idle: #5f6672; --idle-pale: #eceef1; --mixed: #7a5200; --mixed-pale: #fdf1d6;
  --passed: #155e75; --passed-pale: #d5ecf2; --selected: #3c3c96;
  --selected-pale: #e3e3f6; --running: #1b4f93; --running-pale: #dbe8f9;
}
@media (prefers-color-scheme: dark) {
  :root {
    --good: #5fd3a3; --good-pale: #143528; --bad: #ff9d78; --bad-pale: #43221a;
    --idle: #a3acb8; --idle-pale: #2b313a; --mixed: #f5cd6a; --mixed-pale: #40340f;
    --passed: #8fdcf2; --passed-pale: #123744; --selected: #b9b9ff;
    --selected-pale: #2a2a52; --running: #9dc6f8; --running-pale: #18324f;
  }
}
.badge, .chip, .status {
  display: inline-block; padding: 1px 10px; border-radius: 99px; font-weight: 600;
  color: var(--idle); background: var(--idle-pale); white-space: nowrap;
}
:is(.badge, .chip, .status).verified {
  color: var(--good); background: var(--good-pale); }
:is(.badge, .chip, .status):is(.passed, .trained, .finished) {
  color: var(--passed); background: var(--passed-pale); }
:is(.badge, .chip, .status).selected {
  color: var(--selected); background: var(--selected-pale); }
:is(.badge, .chip, .status).running {
  color: var(--running); background: var(--running-pale); }
:is(.badge, .chip, .status):is(.not-verified, .fault, .failed, .unreadable) {
  color: var(--bad); background: var(--bad-pale); }
:is(.badge, .chip, .status):is(.mixed, .budget, .interrupted, .killed, .unfinished,
  .not-finished, .not-at-its-end) {
  color: var(--mixed); background: var(--mixed-pale); }
"""
