// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// Feeds the charts of a page: keeps their points, adds what the server sends, follows the theme.
// The charts themselves are Apache ECharts, as NiceGUI brings it.

(() => {
  const charts = new Map(); // element id -> {spec, data}
  const css = (name) => getComputedStyle(document.body).getPropertyValue(name).trim();
  const chartOf = (id) => {
    const element = typeof getElement === 'function' ? getElement(id) : undefined;
    return element && element.chart && !element.chart.isDisposed() ? element.chart : undefined;
  };
  const clock = (value) => (value < 1e8
    ? `${+value.toFixed(2)} s`
    : new Date(value * 1000).toLocaleTimeString());
  const short = (value) => (Math.abs(value) >= 1e-3 && Math.abs(value) < 1e4 || value === 0
    ? `${+value.toPrecision(3)}` : value.toExponential(0));

  function style(id) {
    const chart = chartOf(id);
    const { spec } = charts.get(id);
    if (!chart) return;
    const [ink, muted, line, card] = ['--ink', '--muted', '--line', '--card'].map(css);
    const axis = {
      axisLine: { lineStyle: { color: line } },
      axisTick: { lineStyle: { color: line } },
      splitLine: { lineStyle: { color: line, opacity: 0.6 } },
      minorSplitLine: { lineStyle: { color: line, opacity: 0.25 } },
      axisLabel: { color: muted },
      nameTextStyle: { color: muted },
    };
    const label = (format) => ({ ...axis.axisLabel, formatter: format });
    chart.setOption({
      textStyle: { color: ink, fontFamily: css('--font') },
      legend: { textStyle: { color: muted } },
      tooltip: {
        backgroundColor: card, borderColor: line, textStyle: { color: ink },
        valueFormatter: (v) => (v == null ? '–' : short(v)),
      },
      axisPointer: { label: { formatter: (p) => (p.axisDimension === 'x' && !spec.xy
        ? clock(p.value) : short(p.value)) } },
      xAxis: { ...axis, axisLabel: label(spec.xy ? short : clock) },
      yAxis: { ...axis, axisLabel: label(short) },
      series: spec.colors.map((name) => ({
        lineStyle: { color: css(name) }, itemStyle: { color: css(name) },
        markArea: { itemStyle: { color: css('--alarm-area') } },
        markLine: { lineStyle: { color: css('--muted') }, label: { color: muted } },
      })),
    });
  }

  function draw(id) {
    const chart = chartOf(id);
    const entry = charts.get(id);
    if (!chart || !entry) return;
    if (entry.chart !== chart) { entry.chart = chart; style(id); }
    const option = { series: entry.data.map((points) => ({ data: points })) };
    if (entry.range && !entry.spec.xy) {
      option.xAxis = { min: entry.range[0], max: entry.range[1] };
    }
    if (entry.areas) option.series[0].markArea = { data: entry.areas };
    chart.setOption(option, { lazyUpdate: true });
  }

  // One message of the server: per chart {from, series, range, areas, all}. Points from `from` on
  // are replaced by the new ones, points before the range are dropped.
  function push(message) {
    for (const [key, part] of Object.entries(message)) {
      const id = Number(key);
      const entry = charts.get(id);
      if (!entry) continue;
      entry.range = part.range || entry.range;
      if (part.areas) entry.areas = part.areas;
      entry.data = entry.data.map((old, n) => {
        const fresh = part.series[n];
        if (!fresh) return old;
        if (part.all) return fresh;
        const from = part.from[n];
        const start = entry.range[0];
        let end = old.length;
        while (end > 0 && old[end - 1][0] >= from) end -= 1;
        let begin = 0;
        while (begin + 1 < end && old[begin + 1][0] < start) begin += 1;
        return old.slice(begin, end).concat(fresh);
      });
      draw(id);
    }
    window.damadics.messages += 1;
  }

  function register(id, spec) {
    charts.set(id, { spec, data: spec.colors.map(() => []) });
    const wait = () => (chartOf(id) ? draw(id) : setTimeout(wait, 50));
    wait();
  }

  function say(text) {
    const region = document.getElementById('announcer');
    if (region) region.textContent = text;
  }

  window.damadics = { register, push, say, messages: 0, points: (id) => charts.get(id).data };
  const restyle = () => charts.forEach((_, id) => { style(id); });
  const start = () => new MutationObserver(() => setTimeout(restyle, 30))
    .observe(document.body, { attributes: true, attributeFilter: ['class'] });
  if (document.body) start(); else document.addEventListener('DOMContentLoaded', start);
})();
