// The theme loads the search on every page; Sphinx then does not mark the words that it found.
window.addEventListener("load", async () => {
  if (document.getElementById("search-results")) return;
  await window.MathJax?.startup?.promise;
  SphinxHighlight.highlightSearchWords();
  const show = () => document.querySelector("article .highlighted")?.scrollIntoView({ block: "center" });
  setTimeout(show, 100);
});

// The filters of the claims know a dark page by this class only.
const dark = () => document.documentElement.classList.toggle("dark", document.documentElement.dataset.theme === "dark");
new MutationObserver(dark).observe(document.documentElement, { attributeFilter: ["data-theme"] });
dark();

// What scrolls inside itself can be scrolled by keyboard.
const reach = () => document.querySelectorAll("article *").forEach((box) => {
  const scrolls = box.scrollWidth > box.clientWidth && getComputedStyle(box).overflowX === "auto";
  if (scrolls && !box.hasAttribute("tabindex")) box.tabIndex = 0;
});
window.addEventListener("load", reach);
window.addEventListener("resize", reach);
