"use strict";
(() => {
  const METRES_A_DEGREE = 111320; // of latitude; near enough to draw with
  const main = document.querySelector("main");
  const gridNote = document.querySelector(".grid-note");
  const data = JSON.parse(document.getElementById("data").textContent);
  const placed = data.collection.features.filter((feature) => feature.geometry);
  const everything = [
    ...data.track,
    ...placed.map((feature) => feature.geometry.coordinates),
    ...data.truth.filter(Boolean),
  ];
  if (everything.length === 0) {
    main.dataset.map = "failed";
    return;
  }

  // A survey across longitude 180 stays in one piece: all longitudes lie near the first.
  const lon0 = everything[0][0];
  const near = ([lon, lat]) => [lon0 + ((((lon - lon0 + 180) % 360) + 360) % 360) - 180, lat];
  const point = (place, properties = {}) => ({
    type: "Feature", properties, geometry: { type: "Point", coordinates: near(place) },
  });
  const collect = (features) => ({ type: "FeatureCollection", features });
  const ofKind = (kind) => placed.filter((feature) => feature.properties.kind === kind);

  const circle = (place, radius) => {
    const [lon, lat] = near(place);
    const dLat = radius / METRES_A_DEGREE;
    const dLon = dLat / Math.max(0.01, Math.cos((lat * Math.PI) / 180));
    const ring = Array.from({ length: 65 }, (_, i) => {
      const angle = (i * Math.PI) / 32;
      return [lon + dLon * Math.cos(angle), lat + dLat * Math.sin(angle)];
    });
    return { type: "Feature", properties: {}, geometry: { type: "Polygon", coordinates: [ring] } };
  };
  const radii = (estimates) =>
    collect(estimates.flatMap(({ geometry, properties }) =>
      [properties.radius_95_m, properties.radius_m]
        .filter((radius) => radius != null)
        .map((radius) => circle(geometry.coordinates, radius))));

  const boxOf = (places) => {
    const box = new maplibregl.LngLatBounds();
    places.map(near).forEach((place) => box.extend(place));
    return box;
  };
  const framing = (animate) => ({ padding: 56, maxZoom: 19, animate });

  const style = {
    version: 8,
    sources: {
      grid: { type: "geojson", data: collect([]) },
      track: { type: "geojson", data: collect(data.track.map((place) => point(place))) },
      radii: { type: "geojson", data: collect([]) },
      matches: { type: "geojson", data: collect(ofKind("match").map((f) => point(f.geometry.coordinates))) },
      estimates: { type: "geojson", data: collect(ofKind("estimate").map((f) => point(f.geometry.coordinates))) },
    },
    layers: [
      { id: "paper", type: "background", paint: { "background-color": "#f3f1ea" } },
      { id: "grid", type: "line", source: "grid", paint: { "line-color": "#dcd8cd", "line-width": 1 } },
      { id: "radii", type: "fill", source: "radii", paint: { "fill-color": "#c8551d", "fill-opacity": 0.13 } },
      { id: "rims", type: "line", source: "radii", paint: { "line-color": "#c8551d", "line-width": 1.2, "line-opacity": 0.7 } },
      { id: "track", type: "circle", source: "track", paint: { "circle-color": "#8b98a3", "circle-radius": ["interpolate", ["linear"], ["zoom"], 10, 1.2, 18, 3.2] } },
      { id: "matches", type: "circle", source: "matches", paint: { "circle-color": "#1f4e79", "circle-opacity": 0.55, "circle-radius": 4 } },
      { id: "estimates", type: "circle", source: "estimates", paint: { "circle-color": "#c8551d", "circle-opacity": 0.6, "circle-radius": 4 } },
    ],
  };

  let map;
  try {
    map = new maplibregl.Map({
      container: "map", style, bounds: boxOf(everything), fitBoundsOptions: framing(false),
      attributionControl: false, dragRotate: false, pitchWithRotate: false, fadeDuration: 0,
    });
  } catch (error) {
    main.dataset.map = "failed";
    return;
  }
  map.touchZoomRotate.disableRotation();
  map.keyboard.disableRotation();
  map.addControl(new maplibregl.NavigationControl({ showCompass: false }), "top-right");
  map.addControl(new maplibregl.ScaleControl({ maxWidth: 120, unit: "metric" }), "bottom-left");

  const drawGrid = () => {
    const bounds = map.getBounds();
    const { lat } = map.getCenter();
    const metresAPixel =
      ((bounds.getNorth() - bounds.getSouth()) * METRES_A_DEGREE) / map.getContainer().clientHeight;
    const wanted = metresAPixel * 90;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const step = [1, 2, 5, 10].map((n) => n * power).find((metres) => metres >= wanted);
    if (step > 100000) {
      gridNote.textContent = "";
      map.getSource("grid").setData(collect([]));
      return;
    }
    gridNote.textContent = step >= 1000 ? `grid ${step / 1000} km` : `grid ${step} m`;
    const dLat = step / METRES_A_DEGREE;
    const dLon = dLat / Math.max(0.01, Math.cos((lat * Math.PI) / 180));
    const [west, south, east, north] = [bounds.getWest(), bounds.getSouth(), bounds.getEast(), bounds.getNorth()];
    const [high, wide] = [north - south, east - west];
    const lines = [];
    for (let x = Math.floor((west - wide) / dLon); x <= (east + wide) / dLon; x += 1) {
      lines.push([[x * dLon, south - high], [x * dLon, north + high]]);
    }
    for (let y = Math.floor((south - high) / dLat); y <= (north + high) / dLat; y += 1) {
      lines.push([[west - wide, y * dLat], [east + wide, y * dLat]]);
    }
    map.getSource("grid").setData(
      collect(lines.map((coordinates) => ({
        type: "Feature", properties: {}, geometry: { type: "LineString", coordinates },
      }))),
    );
  };

  let pins = [];
  const pin = (place, kind, text, title) => {
    const element = document.createElement("div");
    element.className = `pin ${kind}`;
    element.textContent = text;
    element.title = title;
    pins.push(new maplibregl.Marker({ element }).setLngLat(near(place)).addTo(map));
  };

  // One panorama gives several images: matches of one position share a pin.
  const pinMatches = (matches) => {
    const byPlace = new Map();
    matches.forEach((match) => {
      const key = match.geometry.coordinates.slice(0, 2).join();
      byPlace.set(key, [...(byPlace.get(key) ?? []), match]);
    });
    [...byPlace.values()].reverse().forEach((group) => {
      const ranks = group.map((match) => match.properties.rank);
      const shown = ranks.length > 4 ? [...ranks.slice(0, 4), "…"] : ranks;
      pin(
        group[0].geometry.coordinates, ranks.includes(1) ? "match first" : "match", shown.join("·"),
        group.map((match) => `${match.properties.rank}. ${match.properties.image}`).join("\n"),
      );
    });
  };

  let chosen = 0;
  const choose = (i, animate) => {
    chosen = i;
    document.querySelectorAll(".sheet").forEach((sheet, j) => sheet.classList.toggle("chosen", i === j));
    pins.forEach((old) => old.remove());
    pins = [];
    const query = data.queries[i];
    const own = placed.filter((feature) => feature.properties.query === query);
    const matches = own
      .filter((feature) => feature.properties.kind === "match" && feature.properties.rank <= 10)
      .sort((a, b) => a.properties.rank - b.properties.rank);
    const estimates = own.filter((feature) => feature.properties.kind === "estimate");
    const targets = own.filter((feature) => feature.properties.kind === "target");
    const truth = data.truth[i];
    map.getSource("radii").setData(radii(estimates));
    estimates.forEach((e) => pin(e.geometry.coordinates, "estimate", "", `estimate, within ${e.properties.radius_m} m (68 %)`));
    targets.forEach((t) => pin(t.geometry.coordinates, "target", "★", `what it shows, within ${t.properties.radius_m} m`));
    pinMatches(matches);
    if (truth) pin(truth, "truth", "", "true position");
    const shown = [...own.map((feature) => feature.geometry.coordinates), ...(truth ? [truth] : [])];
    if (shown.length > 0) map.fitBounds(boxOf(shown), framing(animate));
  };

  document.querySelectorAll(".query").forEach((button, i) => {
    button.addEventListener("click", () => choose(i, true));
  });
  map.on("load", () => {
    drawGrid();
    map.on("moveend", drawGrid);
    if (data.queries.length > 0) {
      choose(0, false);
      map.on("resize", () => choose(chosen, false));
    }
    map.once("idle", () => {
      main.dataset.drawn = map.queryRenderedFeatures({ layers: ["track", "matches", "estimates"] }).length;
      main.dataset.map = "drawn";
    });
  });
})();
