<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>
<qgis version="3.22.0" styleCategories="Symbology|Labeling|Fields|MapTips|Rendering">
  <renderer-v2 type="graduatedSymbol" attr="rank" graduatedMethod="GraduatedColor" symbollevels="0" enableorderby="1" forceraster="0">
    <ranges>{{rank_ranges}}</ranges>
    <symbols>
{{rank_symbols}}    </symbols>
    <orderby>
      <orderByClause asc="0" nullsFirst="0">"rank"</orderByClause>
    </orderby>
  </renderer-v2>
  <!-- The marks have their numbers on them; here they only keep the names of photos away. -->
  <labeling type="simple">
    <settings calloutType="simple">
      <text-style fieldName="&quot;rank&quot;" isExpression="1" fontSize="8" fontSizeUnit="Point"/>
      <placement placement="1" dist="0"/>
      <rendering drawLabels="0" obstacle="1" obstacleFactor="1" obstacleType="0"/>
    </settings>
  </labeling>
  <blendMode>0</blendMode>
  <featureBlendMode>0</featureBlendMode>
  <layerOpacity>1</layerOpacity>
  <aliases>{{aliases}}</aliases>
  <previewExpression>"name"</previewExpression>
  <mapTip>{{map_tip}}</mapTip>
</qgis>
