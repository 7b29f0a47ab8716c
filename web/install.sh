#!/bin/sh
# Fetches the tools of the web pages as package-lock.json names them. Some of them ask for Node 20.19 or later, and npm before 11
# leaves those out without an error, or takes the link to Node away. Where the system's are older, as Debian 12's are, the Node and
# the npm that node/package-lock.json names are fetched first and do it.
set -eu
cd "$(dirname "$0")"

is_new_enough() {
  node -e 'const [major, minor] = process.versions.node.split(".").map(Number);
    process.exit(major > 22 || (major === 22 && minor >= 12) || (major === 20 && minor >= 19) ? 0 : 1)' \
    && [ "$(npm --version | cut -d. -f1)" -ge 11 ]
}

if is_new_enough; then
  npm ci --no-progress
else
  (cd node && npm ci --no-progress)
  node/node_modules/node-linux-*/bin/node node/node_modules/npm/bin/npm-cli.js ci --no-progress
fi
