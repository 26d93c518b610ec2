import react from "@vitejs/plugin-react";
import type { HtmlTagDescriptor, Plugin } from "vite";
import { defineConfig } from "vitest/config";

// The edge server serves the built files below /console/; in development its paths are passed on.
const EDGE = process.env["EDGE_URL"] ?? "http://127.0.0.1:8000";
const PATHS = [
  "session", "sessions", "users", "live", "flights", "flight_maps", "alarms", "vehicles", "plans", "events",
  "fields", "surveys", "maps", "keys", "audit", "dead_letters", "readyz",
  "videos", "storage", "backups",
];

/** Lets the browser fetch and compile the map beside the rest: it is the largest part of the first screen. */
function preloadMap(): Plugin {
  return {
    name: "preload-map",
    transformIndexHtml: {
      order: "post",
      handler: (_html, { bundle = {} }) => {
        const chunks = Object.values(bundle).filter((file) => file.type === "chunk");
        const map = chunks.find((chunk) => chunk.facadeModuleId?.endsWith("/map/FarmMap.tsx"));
        const entry = chunks.find((chunk) => chunk.isEntry);
        const files = map === undefined ? [] : [map.fileName, ...map.imports];
        return files
          .filter((name) => name !== entry?.fileName)
          .map((name): HtmlTagDescriptor => ({
            tag: "link",
            attrs: { rel: "modulepreload", crossorigin: true, href: `/console/${name}` },
            injectTo: "head",
          }));
      },
    },
  };
}

export default defineConfig({
  base: "/console/",
  plugins: [react(), preloadMap()],
  resolve: {
    // MapLibre's usual build makes its worker from a string, which the server's policy forbids.
    alias: [{ find: /^maplibre-gl$/, replacement: "maplibre-gl/dist/maplibre-gl-csp.js" }],
  },
  build: {
    target: "es2022",
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1200,
    rollupOptions: { output: { manualChunks: { map: ["maplibre-gl", "pmtiles"] } } },
  },
  server: { proxy: Object.fromEntries(PATHS.map((path) => [`/${path}`, EDGE])) },
  test: {
    include: ["tests/**/*.test.ts"],
    environment: "node",
    // Used again for the next file: to start a worker for each takes longer than the tests. A test
    // undoes what it changes in a module
    pool: "threads",
    isolate: false,
    // It ends a test that hangs, and fails none on a slow machine
    testTimeout: 120_000,
  },
});
