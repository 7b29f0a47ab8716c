// English: calibrating cameras in Set-up.

export const cameras = {
} as const;
