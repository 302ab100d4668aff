// The page of maplibre.html: shows terrain.pmtiles of another server as terrain, and sends the server the elevations at the places of
// the request, [longitude, latitude], and what MapLibre and the console complain of. This is the code of docs/viewing.md.
import * as maplibregl from 'maplibre-gl';
import { PMTiles, Protocol } from 'pmtiles';

const complaints = [];
for (const kind of ['error', 'warn']) {
  const say = console[kind];
  console[kind] = (...words) => { complaints.push(words.join(' ')); say.apply(console, words); };
}

const { places, archive } = await (await fetch('/request.json')).json();

async function shown() {
  const protocol = new Protocol();
  maplibregl.addProtocol('pmtiles', protocol.tile);
  const { encoding, tileSize } = await new PMTiles(archive).getMetadata();
  const map = new maplibregl.Map({
    container: 'map',
    canvasContextAttributes: { preserveDrawingBuffer: true },
    attributionControl: false,
    center: places[0],
    zoom: 16.5,
    pitch: 60,
    maxPitch: 80,
    style: {
      version: 8,
      sources: Object.fromEntries(['terrain', 'relief'].map((name) => [name, { type: 'raster-dem', url: `pmtiles://${archive}`, encoding, tileSize }])),
      layers: [
        { id: 'ground', type: 'background', paint: { 'background-color': '#8fb3d9' } },
        { id: 'shade', type: 'hillshade', source: 'relief' },
      ],
      terrain: { source: 'terrain' },
    },
  });
  map.on('error', ({ error }) => complaints.push(error?.message ?? 'an error of MapLibre'));
  const heights = [];
  for (const place of places) {
    map.jumpTo({ center: place });
    await new Promise((resolve) => { map.once('idle', resolve); map.triggerRepaint(); });
    heights.push(map.queryTerrainElevation(place));
  }
  return { heights, complaints, encoding, tileSize, picture: map.getCanvas().toDataURL('image/png') };
}

const result = await shown().catch((error) => ({ error: String(error.stack ?? error), complaints }));
await fetch('/result', { method: 'POST', body: JSON.stringify(result) });
