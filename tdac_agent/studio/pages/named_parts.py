"""Names for screen readers of parts that Quasar leaves without one.

Its file chooser is a button with a field inside, without a name; checkboxes of tables
have none, and the text for a picture does not reach the picture.
"""

NAMED = """<script>
(() => {
  const name = (element, text) => {
    if (text && element.getAttribute("aria-label") !== text)
      element.setAttribute("aria-label", text);
  };
  const look = () => {
    for (const picture of document.querySelectorAll(".board[alt] img")) {
      const text = picture.closest(".board").getAttribute("alt");
      if (picture.alt !== text) picture.alt = text;
    }
    for (const input of document.querySelectorAll(".q-uploader__input")) {
      const box = input.closest(".q-uploader");
      name(input, box.querySelector(".q-uploader__title")?.textContent);
      input.tabIndex = 0;
      const button = input.closest("a");
      if (button?.getAttribute("role") === "button") {
        button.setAttribute("role", "group");
        button.tabIndex = -1;
        name(button, "choice of a file");
      }
    }
    for (const box of document.querySelectorAll(".q-table .q-checkbox")) {
      const row = box.closest("tr");
      const cell = row.querySelector("td a, td:nth-child(2)");
      name(box, row.closest("thead") ? "choose all" : `choose ${cell?.textContent}`);
    }
  };
  let waiting = false;
  new MutationObserver(() => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; look(); });
  }).observe(document, { childList: true, subtree: true, attributes: true,
                         attributeFilter: ["alt", "role", "tabindex"] });
})();
</script>"""
