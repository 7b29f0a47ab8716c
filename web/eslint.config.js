// What the pages' code keeps to: TypeScript's strict rules and those for accessibility.

import js from "@eslint/js";
import accessibility from "eslint-plugin-jsx-a11y";
import typescript from "typescript-eslint";

export default typescript.config(
  { ignores: ["dist", "src/contract.gen.ts", "test-results", "eslint.config.js"] },
  js.configs.recommended,
  ...typescript.configs.strictTypeChecked,
  accessibility.flatConfigs.strict,
  {
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    rules: {
      // The loops of polling end with their page.
      "@typescript-eslint/no-unnecessary-condition": ["error", { allowConstantLoopConditions: true }],
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-confusing-void-expression": ["error", { ignoreArrowShorthand: true }],
      // Handlers of events may wait; what goes wrong in them is told where it happens.
      "@typescript-eslint/no-misused-promises": ["error", { checksVoidReturn: { attributes: false } }],
    },
  },
);
