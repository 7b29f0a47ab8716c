// English. A language is a folder such as this: the same keys, other words.

import { app } from "./app";
import { cameras } from "./cameras";
import { geometry } from "./geometry";
import { operate } from "./operate";
import { setup } from "./setup";
import { spatial } from "./spatial";
import { system } from "./system";
import { wall } from "./wall";

export const en = { ...app, ...operate, ...setup, ...cameras, ...geometry, ...spatial, ...wall, ...system } as const;
