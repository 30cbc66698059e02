"""The style of all pages, light and dark."""

from tdac_agent.html_report.status_style import STATUS_STYLE

PRIMARY = "#1d5fae"
"""Colour of what can be pressed; white on it has a contrast of 6."""
STYLE = (
    STATUS_STYLE
    + """
:root {
  --page: #f6f6f3; --ink: #23262e; --code: #eceae3; --line: #d4d2c8; --edge: #bdbab0;
  --soft: #5d6068; --link: #1d5fae; --strong: #3d4048; --differs: #fbf0da;
  --added-pale: #e3f5ec; --added: #075e3d; --removed-pale: #fcebe4;
  --removed: #9a2c05; --hunk: #6a61b8; --hunk-pale: #f2f1fa; --paper: white;
}
body.body--dark {
  --page: #14171c; --ink: #e6e9ee; --code: #262b33; --line: #3a424d; --edge: #5a636f;
  --soft: #a3acb8; --link: #8db8f0; --strong: #c3cad3; --differs: #403410;
  --added-pale: #12372a; --added: #7fe0b4; --removed-pale: #46241a;
  --removed: #ffae8c; --hunk: #b3abff; --hunk-pale: #262a40; --paper: #1d2127;
}
:root { color-scheme: light dark; }
/* Until the scripts say which of both it is. */
@media (prefers-color-scheme: dark) {
  body:not(.body--dark, .body--light) { --page: #14171c; }
}
body, body.body--dark { font-family: system-ui, sans-serif; background: var(--page);
  color: var(--ink); }
h1, h2, h3 { margin: 0; line-height: 1.3; }
h1 { font-size: 1.4rem; font-weight: 700; overflow-wrap: anywhere; }
h2 { font-size: 1.125rem; font-weight: 700; }
h3 { font-size: 1rem; font-weight: 700; }
.q-btn { text-transform: none; }
.body--dark :is(.q-btn--outline, .q-btn--flat, .q-radio, .q-checkbox, .q-slider,
  .q-toggle) { --q-primary: var(--link); }
.q-btn-group { border: 1px solid var(--edge); box-shadow: none; }
.q-btn-group .q-btn { padding-inline: .7em; }
.body--dark .q-chip { background: var(--line); }
.q-header a { color: white; text-decoration: none; padding: .1em 0; }
.q-header a[aria-current] { border-bottom: 2px solid #8db8f0; }
.q-header { background: #23262e; }
.nicegui-content { max-width: 1500px; margin: 0 auto; width: 100%; }
code.command { display: block; background: var(--code); padding: .6em .8em;
  border-radius: 6px; white-space: pre-wrap; overflow-wrap: anywhere;
  font-size: .85rem; width: 100%; }
code.command span { display: inline-block; max-width: 100%; }
.board { width: 100%; border: 1px solid var(--line); border-radius: 6px;
  overflow: hidden; }
.keys { width: 100%; }
.keys:focus { outline: none; }
.keys:focus-visible .board { outline: 3px solid var(--link); outline-offset: 2px; }
kbd { font: inherit; font-size: .85em; padding: 0 .4em; border-radius: 4px;
  border: 1px solid var(--edge); background: var(--paper); color: var(--ink); }
.board img { width: 100%; cursor: crosshair; }
.choosing { display: grid; gap: 1.5rem; width: 100%; }
@media (min-width: 1024px) {
  .choosing { grid-template-columns: 26rem minmax(0, 1fr); }
  .beside { position: sticky; top: 4rem; align-self: start;
    --room: (100vh - 14rem); } /* height for the map */
}
@media (max-width: 1023px) {
  .choosing { grid-template-columns: minmax(0, 1fr); }
  .beside { order: -1; --room: 55vh; }
  /* What is below the map would push its controls out of sight. */
  .keys:not(:focus-visible) ~ #map-keys { display: none; }
  /* What was found is in sight while the map above it is clicked. */
  .found { position: sticky; bottom: 0; z-index: 2; padding: .4em 0; width: 100%;
    background: var(--page); border-top: 1px solid var(--line); }
}
.world { width: min(100%, 78vh); }
.problem { color: var(--bad); } .fine { color: var(--good); }
.note { color: var(--soft); }
.trail { font-size: .85rem; color: var(--soft); }
.trail ol { display: flex; flex-wrap: wrap; margin: 0; padding: 0; list-style: none; }
.trail li { overflow-wrap: anywhere; }
.trail li + li::before { content: "›" / ""; margin: 0 .5em; }
.trail a { color: var(--link); }
.empty { border: 1px dashed var(--edge); border-radius: 8px; padding: .8em 1em;
  width: 100%; gap: .5rem; }
.reported { position: relative; width: 100%; }
.reported > .note { position: absolute; padding: 1em 1.2em; }
iframe.report { border: 1px solid var(--line); border-radius: 6px; width: 100%;
  height: 82vh; background: var(--paper); }
.q-uploader { width: 100%; max-width: 32rem; border: 2px dashed var(--edge);
  border-radius: 8px; background: none; }
.q-uploader:hover, .q-uploader:focus-within { border-color: var(--link); }
.q-uploader__header { background: none; color: var(--strong); border-radius: 0; }
.q-uploader__header-content { position: relative; }
.q-uploader__title { font-size: .9rem; font-weight: 500; line-height: 1.4;
  white-space: normal; }
.q-uploader__subtitle, .q-uploader__list { display: none; }
/* A click anywhere opens the choice of a file. */
.q-uploader .q-btn, .q-uploader .q-btn .q-btn__content { position: static; }
.q-uploader__input { inset: 0; width: 100%; height: 100%; }
.nicegui-link { color: var(--link); }
.compared { width: 100%; border-collapse: collapse; background: var(--paper);
  font-size: .9rem; }
.compared td, .compared th { text-align: left; vertical-align: top; padding: .3em .6em;
  border-bottom: 1px solid var(--line); overflow-wrap: anywhere; width: 35%; }
.compared td:first-child, .compared th:first-child { width: 1.6em; font-weight: 700;
  color: var(--bad); padding-right: 0; }
.compared td:nth-child(2) { color: var(--soft); width: auto; }
.compared .differs { background: var(--differs); }
.compared .differs td { font-weight: 600; }
@media (max-width: 600px) {
  .compared { font-size: .8rem; }
  .compared td, .compared th { padding-inline: .3em; }
}
.diff { background: var(--paper); border: 1px solid var(--line);
  border-radius: 6px; width: 100%; margin: 0; padding: .6em 0; overflow: auto;
  max-height: 36rem; font-size: .8rem; }
.diff > * { display: block; padding: 0 .8em; width: max-content; min-width: 100%;
  text-decoration: none; }
.diff ins { background: var(--added-pale); color: var(--added); }
.diff del { background: var(--removed-pale); color: var(--removed); }
.diff b { color: var(--hunk); background: var(--hunk-pale); font-weight: 400; }
#lost:not([hidden]) { position: fixed; inset: auto 0 0 0; z-index: 9999;
  padding: .8em 1.2em; background: var(--bad); color: var(--page);
  overflow-wrap: anywhere; }
#popup { display: none; } /* NiceGUI's own word about it */
pre.output { white-space: pre-wrap; overflow-wrap: anywhere; font-size: .8rem;
  max-height: 16rem; overflow: auto; width: 100%; margin: 0; }
"""
)
