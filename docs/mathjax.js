// Formulas are typeset by MathJax.  Only pages that have some load it: other pages ask no other server for anything.
window.MathJax = {
  tex: { inlineMath: [["\\(", "\\)"]], displayMath: [["\\[", "\\]"]], processEscapes: true, processEnvironments: true },
  options: { ignoreHtmlClass: ".*|", processHtmlClass: "arithmatex" },
};
document$.subscribe(() => {
  if (!document.querySelector(".arithmatex")) return;
  if (MathJax.typesetPromise) {
    MathJax.startup.output.clearCache();
    MathJax.typesetClear();
    MathJax.texReset();
    MathJax.typesetPromise();
  } else if (!document.querySelector("script[data-formulas]")) {
    const script = document.createElement("script");
    script.src = "https://unpkg.com/mathjax@3.2.2/es5/tex-mml-chtml.js";
    script.dataset.formulas = "";
    document.head.append(script);
  }
});
