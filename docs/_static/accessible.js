// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// What the theme's markup lacks for keyboards and screen readers.
function makeScrollableFocusable() {
  for (const one of document.querySelectorAll("pre, .table-wrapper")) {
    if (one.scrollWidth > one.clientWidth) one.tabIndex = 0;
    else one.removeAttribute("tabindex");
  }
}

document.addEventListener("DOMContentLoaded", () => {
  for (const one of document.querySelectorAll(".caption[role=heading]")) one.ariaLevel = 2;
  document.querySelector(".sidebar-drawer")?.setAttribute("aria-label", "Site");
  document.querySelector(".toc-drawer")?.setAttribute("aria-label", "On this page");
  makeScrollableFocusable();
});
window.addEventListener("resize", makeScrollableFocusable);
