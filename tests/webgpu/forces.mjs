// Compares the forces of two reports.
//
//   node forces.mjs REPORT REPORT

import fs from "node:fs";

const forces = (path) => {
    const { steps } = JSON.parse(fs.readFileSync(path, "utf8"));
    const all = steps.flatMap((step) => [...step.contacts, ...step.supports]);
    return all.flatMap((place) => place.force ?? []);
};
const [a, b] = process.argv.slice(2).map(forces);
const scale = Math.max(...a.map(Math.abs));
const apart = Math.max(...a.map((force, i) => Math.abs(force - b[i]))) / scale;
console.log(`forces differ by ${apart.toExponential(1)}`);
// Written so that NaN fails.
process.exit(a.length > 0 && a.length === b.length && apart < 1e-6 ? 0 : 1);
