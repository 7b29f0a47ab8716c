// English: what stands in a scene, in Set-up.

export const geometry = {
} as const;
