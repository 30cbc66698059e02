"""Frames as high as the reports in them, so that only the page itself scrolls.

A report has no rights and cannot be measured from outside; it tells its height, and
where one of its links leads.
"""

FITTED = """<script>
addEventListener("message", (event) => {
  const frames = [...document.querySelectorAll("iframe.report")];
  const frame = frames.find((each) => each.contentWindow === event.source);
  const { height, at } = event.data?.tdac ?? {};
  if (!frame) return;
  if (Number.isFinite(height))
    frame.style.height = `${Math.min(Math.max(height, 200), 60000) + 2}px`;
  if (Number.isFinite(at)) {
    const top = scrollY + frame.getBoundingClientRect().top + at;
    scrollTo({ top: Math.max(0, top - 64) });
  }
});
</script>"""
