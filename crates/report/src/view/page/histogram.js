// @ts-check
/**
 * Histograms of defocus and incidence by marked length, whose bars filter the view.
 *
 * A bar is a button. Pressing it shows only the marks within its limits; with Shift, or by dragging over bars, an
 * interval; pressing the only chosen bar again shows all.
 */

class HistogramView {
  /**
   * @param {HTMLElement} place @param {Histogram} histogram @param {string} unit
   * @param {(value: number) => Colour} colourOf
   * @param {(interval: [number, number]|null) => void} filter
   */
  constructor(place, histogram, unit, colourOf, filter) {
    this.histogram = histogram;
    this.unit = unit;
    this.colourOf = colourOf;
    this.filter = filter;
    /** First and last chosen bar. @type {[number, number]|null} */
    this.chosen = null;
    /** Where dragging began, -1 for nowhere. */
    this.from = -1;
    place.classList.add("histogram");
    this.row = place.appendChild(document.createElement("div"));
    this.row.className = "bars";
    const { edges, length_mm } = histogram;
    const most = Math.max(...length_mm, 1e-9);
    this.bars = length_mm.map((length, i) => this.bar(i, length, most));
    const scale = place.appendChild(document.createElement("div"));
    scale.className = "scale";
    const marks = [edges[0], edges[edges.length >> 1], edges[edges.length - 1]];
    for (const edge of marks) scale.appendChild(document.createElement("span")).textContent = shortNumber(edge);
    this.words = place.appendChild(document.createElement("p"));
    this.words.className = "note";
    this.row.addEventListener("pointerup", () => (this.from = -1));
    this.row.addEventListener("pointerleave", () => (this.from = -1));
    this.show();
  }

  /** @param {number} i @param {number} length @param {number} most */
  bar(i, length, most) {
    const bar = this.row.appendChild(document.createElement("button"));
    bar.type = "button";
    const { edges } = this.histogram;
    const label = `${shortNumber(edges[i])} to ${shortNumber(edges[i + 1])} ${this.unit}: ${this.amount(length)}`;
    bar.title = label;
    bar.setAttribute("aria-label", label);
    bar.style.setProperty("--share", String(length > 0 ? Math.max(length / most, 0.015) : 0));
    bar.addEventListener("pointerdown", (e) => {
      bar.releasePointerCapture(e.pointerId);
      if (!e.shiftKey) this.from = i;
    });
    bar.addEventListener("pointerenter", () => {
      if (this.from >= 0 && this.from !== i) this.choose(this.from, i);
    });
    bar.addEventListener("click", (e) => {
      if (e.shiftKey && this.chosen) this.choose(Math.min(this.chosen[0], i), Math.max(this.chosen[1], i));
      else if (this.chosen?.[0] === i && this.chosen[1] === i) this.clear();
      else if (!(this.chosen && this.chosen[0] !== this.chosen[1] && this.dragged)) this.choose(i, i);
      this.dragged = false;
    });
    return bar;
  }

  /** @param {number} a @param {number} b */
  choose(a, b) {
    this.chosen = [Math.min(a, b), Math.max(a, b)];
    this.dragged = a !== b;
    const { edges } = this.histogram;
    this.show();
    this.filter([edges[this.chosen[0]], edges[this.chosen[1] + 1]]);
  }

  clear() {
    this.chosen = null;
    this.show();
    this.filter(null);
  }

  show() {
    const { edges, length_mm } = this.histogram;
    const [first, last] = this.chosen ?? [0, length_mm.length - 1];
    this.bars.forEach((bar, i) => {
      const isChosen = i >= first && i <= last;
      bar.classList.toggle("off", !isChosen);
      bar.setAttribute("aria-pressed", String(this.chosen !== null && isChosen));
      bar.style.setProperty("--colour", css(this.colourOf((edges[i] + edges[i + 1]) / 2)));
    });
    const sum = length_mm.slice(first, last + 1).reduce((a, b) => a + b, 0);
    this.words.textContent = this.chosen
      ? `Shown: ${shortNumber(edges[first])} to ${shortNumber(edges[last + 1])} ${this.unit}, ` +
        `${this.marks(sum)}.`
      : `${this.marks(sum)} in all. Choose a bar to show only its marks.`;
  }

  /** Of a job of dots alone bars count dots. @param {number} sum */
  amount(sum) {
    return this.histogram.of_dots ? `${Math.round(sum)} dots` : lengthText(sum);
  }

  /** @param {number} sum */
  marks(sum) {
    return this.histogram.of_dots ? this.amount(sum) : `${lengthText(sum)} of marks`;
  }
}

/** At most three figures. @param {number} v */
function shortNumber(v) {
  return String(Number(v.toPrecision(3)));
}

/** @param {number} mm */
function lengthText(mm) {
  return mm >= 1000 ? `${(mm / 1000).toFixed(mm >= 10_000 ? 1 : 2)} m` : `${mm.toFixed(mm >= 10 ? 0 : 1)} mm`;
}
