// Puts <file>.gz beside each large text file of the build: the edge server does not compress.

import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";

const FOLDER = new URL("../dist/assets/", import.meta.url);
const LEAST_BYTES = 4096;

for (const name of readdirSync(FOLDER)) {
  const content = readFileSync(new URL(name, FOLDER));
  if (/\.(css|js|mjs|svg|json)$/.test(name) && content.length >= LEAST_BYTES) {
    writeFileSync(new URL(`${name}.gz`, FOLDER), gzipSync(content, { level: 9 }));
  }
}
