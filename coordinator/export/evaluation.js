"use strict";
(() => {
  const form = document.querySelector(".controls");
  const main = document.querySelector("main");
  const sheets = [...main.querySelectorAll(".sheet")];
  const first = (sheet) => Number(sheet.dataset.first) || Infinity; // 0: no hit at all
  const byName = (a, b) => (a.dataset.query < b.dataset.query ? -1 : 1);
  const worst = (a, b) => a.dataset.ap - b.dataset.ap || byName(a, b);
  const orders = {
    worst,
    best: (a, b) => worst(b, a),
    // Infinity - Infinity is no number: two without a hit are in order of AP.
    first: (a, b) => first(a) - first(b) || worst(a, b),
    name: byName,
  };
  const kinds = {
    all: () => true,
    wrong: (sheet) => first(sheet) > 1,
    none: (sheet) => first(sheet) > 10,
    right: (sheet) => first(sheet) === 1,
  };
  const arrange = () => {
    const { order, show, name } = form.elements;
    const wanted = name.value.toLowerCase();
    main.append(...sheets.sort(orders[order.value]));
    sheets.forEach((sheet) => {
      sheet.hidden = !kinds[show.value](sheet) || !sheet.dataset.query.toLowerCase().includes(wanted);
    });
    form.querySelector("output").textContent =
      `${sheets.filter((sheet) => !sheet.hidden).length} of ${sheets.length} shown`;
  };
  form.addEventListener("input", arrange);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.hidden = false;
  arrange();
})();
